#include "apgm/core/portable_math.hpp"

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace apgm::portable {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kSqrt2 = 0x1.6a09e667f3bcdp+0;
// ln 2 and pi / 2 in parts: the leading ones have trailing zero bits, so that small multiples are exact.
constexpr double kLn2Hi = 0x1.62e42feep-1;
constexpr double kLn2Lo = 0x1.a39ef35793c76p-33;
constexpr double kHalfPi1 = 0x1.921fb544p+0;
constexpr double kHalfPi2 = 0x1.0b4611a6p-34;
constexpr double kHalfPi3 = 0x1.3198a2e037073p-69;

constexpr auto kInverseFactorial = [] {
  std::array<double, 20> table{};
  double factorial = 1;  // exact up to 18!
  for (std::size_t i = 0; i < table.size(); ++i) {
    if (i > 0) factorial *= static_cast<double>(i);
    table[i] = 1.0 / factorial;
  }
  return table;
}();

/// 2/3, 2/5, 2/7, ...
constexpr auto kAtanh = [] {
  std::array<double, 12> table{};
  for (std::size_t i = 0; i < table.size(); ++i) table[i] = 2.0 / static_cast<double>(2 * i + 3);
  return table;
}();

/// 2^k for k in the normal range.
double power_of_two(int k) { return std::bit_cast<double>(static_cast<std::uint64_t>(k + 1023) << 52); }

/// x * 2^k, rounded once also where the result is subnormal.
double scale(double x, int k) {
  if (k > 1023) return x * power_of_two(1023) * power_of_two(k - 1023);
  if (k < -1022) return x * power_of_two(k + 1000) * power_of_two(-1000);
  return x * power_of_two(k);
}

/// Nearest whole number of a small value.
int nearest(double x) { return static_cast<int>(x < 0 ? x - 0.5 : x + 0.5); }

/// ln(1 + f) for sqrt(1/2) <= 1 + f <= sqrt(2), plus `tail`, from 2 atanh(s) = 2 s (1 + z/3 + z^2/5 + ...)
/// with s = f / (2 + f), z = s^2 <= 0.0295. Written as f - f^2/2 + ..., because f is exact and s is not.
double log_near_one(double f, double tail) {
  const double s = f / (2.0 + f);
  const double z = s * s;
  double r = 0;
  for (std::size_t i = kAtanh.size(); i-- > 0;) r = (r + kAtanh[i]) * z;
  const double half_square = 0.5 * f * f;
  return f - (half_square - (s * (half_square + r) + tail));
}

/// (e^r - 1 - r) for |r| <= 0.35, by the series.
double exp_tail(double r) {
  double p = 0;
  for (std::size_t i = kInverseFactorial.size(); i-- > 2;) p = p * r + kInverseFactorial[i];
  return p * r * r;
}

struct Reduced {
  int k = 0;
  double hi = 0;
  double lo = 0;
};

/// x = k ln 2 + hi + lo, |hi + lo| <= ln(2) / 2.
Reduced reduce_exp(double x) {
  const int k = nearest(x * 0x1.71547652b82fep+0);
  return {k, x - k * kLn2Hi, -(k * kLn2Lo)};
}

/// x = k pi/2 + hi + lo, |hi| <= pi/4.
Reduced reduce_angle(double x) {
  const int k = nearest(x * 0x1.45f306dc9c883p-1);
  const double a = x - k * kHalfPi1;
  const double b = k * kHalfPi2;
  const double hi = a - b;
  const double lo = ((a - hi) - b) - k * kHalfPi3;
  return {k, hi, lo};
}

double sin_small(double hi, double lo) {
  const double z = hi * hi;
  double p = 0;
  for (std::size_t i = 19; i >= 3; i -= 2) p = kInverseFactorial[i] - p * z;
  return hi + (lo * (1.0 - 0.5 * z) - hi * (p * z));
}

double cos_small(double hi, double lo) {
  const double z = hi * hi;
  double p = 0;
  for (std::size_t i = 18; i >= 4; i -= 2) p = kInverseFactorial[i] - p * z;
  const double half = 0.5 * z;
  const double head = 1.0 - half;
  return head + (((1.0 - head) - half) + (z * z * p - hi * lo));
}

double quadrant(int k, double hi, double lo) {
  switch (k & 3) {
    case 0:
      return sin_small(hi, lo);
    case 1:
      return cos_small(hi, lo);
    case 2:
      return -sin_small(hi, lo);
    default:
      return -cos_small(hi, lo);
  }
}

bool angle_in_range(double x) { return x >= -1e5 && x <= 1e5; }

}  // namespace

double log(double x) {
  if (!(x > 0)) return x == 0 ? -kInf : kNan;
  if (x == kInf) return x;
  int k = 0;
  if (x < 0x1p-1022) {
    x *= 0x1p54;
    k = -54;
  }
  const auto bits = std::bit_cast<std::uint64_t>(x);
  k += static_cast<int>(bits >> 52) - 1023;
  double m = std::bit_cast<double>((bits & 0x000fffffffffffffu) | 0x3ff0000000000000u);
  if (m > kSqrt2) {
    m *= 0.5;
    ++k;
  }
  return k * kLn2Hi + log_near_one(m - 1.0, k * kLn2Lo);
}

double log1p(double x) {
  if (!(x > -1)) return x == -1 ? -kInf : kNan;
  if (x == kInf) return x;
  if (x > -0.29 && x < 0.41) return log_near_one(x, 0);
  const double u = 1.0 + x;
  const double lost = x > 1 ? 1.0 - (u - x) : x - (u - 1.0);
  return log(u) + lost / u;
}

double exp(double x) {
  if (x != x) return x;
  if (x > 710) return kInf;
  if (x < -746) return 0;
  const Reduced r = reduce_exp(x);
  const double a = r.hi + r.lo;
  const double lost = (r.hi - a) + r.lo;
  return scale(1.0 + (a + (exp_tail(a) + lost)), r.k);
}

double expm1(double x) {
  if (x != x) return x;
  if (x > 710) return kInf;
  if (x < -60) return -1;
  if (x > -0.35 && x < 0.35) return x + exp_tail(x);
  const Reduced r = reduce_exp(x);
  const double a = r.hi + r.lo;
  const double p = a + (exp_tail(a) + ((r.hi - a) + r.lo));
  if (r.k > 60) return scale(1.0 + p, r.k);
  const double two_k = power_of_two(r.k);
  return (two_k - 1.0) + two_k * p;
}

double sin(double x) {
  if (!angle_in_range(x)) return kNan;
  const Reduced r = reduce_angle(x);
  return quadrant(r.k, r.hi, r.lo);
}

double cos(double x) {
  if (!angle_in_range(x)) return kNan;
  const Reduced r = reduce_angle(x);
  return quadrant(r.k + 1, r.hi, r.lo);
}

}  // namespace apgm::portable

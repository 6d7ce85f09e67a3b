// The kernel of two occupancy layers: its error beside exact arithmetic, and its loop for plain cells beside
// the one for any.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>
#include <vector>

#include "fuse/combine_kernels.hpp"
#include "fuse/dempster_loops.hpp"
#include "layers.hpp"

namespace apgm {
namespace {

using test::Random;
constexpr std::size_t kBlock = fuse::loop::kPlainBlock;

/// Cells of two inputs.
struct Pair {
  std::array<std::vector<float>, 4> planes;  // a.o, a.f, b.o, b.f

  explicit Pair(std::size_t cells = 0) { planes.fill(std::vector<float>(cells)); }
  std::size_t cells() const { return planes[0].size(); }
  void set(std::size_t i, std::array<float, 4> masses) {
    for (std::size_t p = 0; p < 4; ++p) planes[p][i] = masses[p];
  }
  fuse::OccupancyPlanes a() const { return {planes[0].data(), planes[1].data()}; }
  fuse::OccupancyPlanes b() const { return {planes[2].data(), planes[3].data()}; }
};

struct Result {
  std::vector<float> o, f, k;
  std::uint64_t total = 0;

  explicit Result(std::size_t cells) : o(cells, -1), f(cells, -1), k(cells, -1) {}
  fuse::OccupancyOut out() { return {o.data(), f.data()}; }
  friend bool operator==(const Result& x, const Result& y) {
    const auto same = [](const std::vector<float>& v, const std::vector<float>& w) {
      return v.size() == w.size() && std::memcmp(v.data(), w.data(), v.size() * sizeof(float)) == 0;
    };
    return same(x.o, y.o) && same(x.f, y.f) && same(x.k, y.k) && x.total == y.total;
  }
};

Result any_cells(const Pair& in) {
  Result r(in.cells());
  r.total = fuse::loop::dempster_any<true>({in.a(), in.b(), r.out(), r.k.data()}, in.cells());
  return r;
}

Result kernel(const Pair& in) {
  Result r(in.cells());
  r.total = fuse::dempster_two(in.a(), in.b(), r.out(), r.k.data(), in.cells());
  return r;
}

/// Masses with o + f <= 1 exactly, of all magnitudes and with all bits in use: the hard roundings of
/// m(Omega).
std::array<float, 2> plain_masses(Random& random) {
  switch (random() % 8) {
    case 0:
      return {0, 0};
    case 1: {  // certain
      const float o = static_cast<float>(random() >> 40) * 0x1p-24f;
      return {o, 1.0f - o};
    }
    case 2: {  // certain but for the last bits
      const float o = 0.5f + 0.5f * test::uniform(random);
      return {o, std::max(0.0f, 1.0f - o - std::ldexp(1.0f, -20 - static_cast<int>(random() % 80)))};
    }
    default: {
      const float o = std::ldexp(test::uniform(random), -static_cast<int>(random() % 140));
      const float f =
          random() % 2 == 0 ? 1.0f - o : std::ldexp(test::uniform(random), -static_cast<int>(random() % 6));
      // In double: floats down to 2^-29 beside 1 add exactly, less cannot lift f <= 1 - 2^-24 over 1.
      if (static_cast<double>(o) + static_cast<double>(f) > 1.0 || (f == 1.0f && o > 0.0f)) return {o, 0};
      return {o, f};
    }
  }
}

Pair plain_cells(std::size_t cells, Random& random) {
  Pair in(cells);
  for (std::size_t i = 0; i < cells; ++i) {
    auto a = plain_masses(random), b = plain_masses(random);
    if (random() % 2 == 0) std::swap(a[0], a[1]);
    if (random() % 2 == 0) std::swap(b[0], b[1]);
    const bool total = (a[0] == 1.0f && b[1] == 1.0f) || (a[1] == 1.0f && b[0] == 1.0f);
    if (total) b = {0, 0};
    in.set(i, {a[0], a[1], b[0], b[1]});
  }
  return in;
}

TEST(DempsterKernel, PlainCellsHaveTheBitsOfAny) {
  Random random(31);
  std::size_t plain = 0;
  for (int round = 0; round < 2000; ++round) {
    const Pair in = plain_cells(kBlock, random);
    Result fast(kBlock);
    plain += fuse::loop::dempster_plain<true>({in.a(), in.b(), fast.out(), fast.k.data()}, kBlock) ? 1 : 0;
    ASSERT_EQ(fast, any_cells(in)) << "seed 31, round " << round;
  }
  EXPECT_EQ(plain, 2000u) << "the cells were not all plain: nothing was tested";
}

TEST(DempsterKernel, AVacuousInputLeavesTheBitsOfTheOther) {
  Random random(32);
  const std::size_t cells = 64 * kBlock;
  Pair in = plain_cells(cells, random);
  for (int p = 0; p < 2; ++p) std::ranges::fill(in.planes[static_cast<std::size_t>(p)], 0.0f);
  const Result right = kernel(in);
  EXPECT_EQ(right.o, in.planes[2]);
  EXPECT_EQ(right.f, in.planes[3]);
  std::swap(in.planes[0], in.planes[2]);
  std::swap(in.planes[1], in.planes[3]);
  EXPECT_EQ(kernel(in), right);
}

TEST(DempsterKernel, OneOddCellOfABlockGoesTheLongWay) {
  // Total conflict; and masses that sum to more than 1, in float32 or exactly only, beside data and beside
  // none.
  const std::array<std::array<float, 4>, 6> odd{{{1, 0, 0, 1},
                                                 {0.8f, 0.2f, 0, 0},
                                                 {0, 0, 0.2f, 0.8f},
                                                 {0.3f, 0.7f, 0.8f, 0.2f},
                                                 {0.6f, 0.4f + 0x1p-20f, 0, 0},
                                                 {0, 1, 0x1p-24f, 1}}};
  Random random(33);
  for (const std::size_t at : {std::size_t{0}, kBlock - 1, kBlock + 77, 3 * kBlock + 5}) {
    for (const auto& masses : odd) {
      Pair in = plain_cells(3 * kBlock + 6, random);
      in.set(at, masses);
      const Result want = any_cells(in);
      EXPECT_EQ(kernel(in), want) << "seed 33, cell " << at << ", " << masses[0] << ' ' << masses[1];
      EXPECT_EQ(want.total, masses[0] == 1.0f ? 1u : 0u);
    }
  }
}

TEST(DempsterKernel, LayersFullOfOddCellsKeepTheirBits) {
  Random random(34);
  Pair in(100 * kBlock + 3);
  for (std::size_t i = 0; i < in.cells(); ++i) {
    // Every block holds cells of total conflict, or the first 40 of them none.
    const float a = test::uniform(random), b = test::uniform(random);
    in.set(i, {a, 1.0f - a, b, 1.0f - b});
    if (i > 40 * kBlock && random() % 16 == 0) in.set(i, {1, 0, 0, 1});
  }
  const Result want = any_cells(in);
  EXPECT_GT(want.total, 0u);
  EXPECT_EQ(kernel(in), want) << "seed 34";
}

TEST(DempsterKernel, AnOutputMayBeAnInput) {
  Random random(35);
  for (const bool odd : {false, true}) {
    Pair in = plain_cells(5 * kBlock + 9, random);
    if (odd) in.set(2 * kBlock, {1, 0, 0, 1});
    const Result want = any_cells(in);
    // Into a, into b, and across: m(O) over b's m(F).
    for (const auto& [o, f] : {std::pair{0, 1}, std::pair{2, 3}, std::pair{3, 0}}) {
      Pair work = in;
      float* const to_o = work.planes[static_cast<std::size_t>(o)].data();
      float* const to_f = work.planes[static_cast<std::size_t>(f)].data();
      EXPECT_EQ(fuse::dempster_two(work.a(), work.b(), {to_o, to_f}, work.cells()), want.total);
      EXPECT_EQ(work.planes[static_cast<std::size_t>(o)], want.o) << "seed 35, plane " << o;
      EXPECT_EQ(work.planes[static_cast<std::size_t>(f)], want.f) << "seed 35, plane " << f;
    }
  }
}

/// Worst error of the masses beside long double, and the greatest conflict below 1 that was met.
struct Worst {
  double mass = 0;
  double conflict = 0;
};

Worst worst_error(const Pair& in) {
  const Result got = kernel(in);
  Worst worst;
  for (std::size_t i = 0; i < in.cells(); ++i) {
    const long double ao = in.planes[0][i], af = in.planes[1][i], bo = in.planes[2][i], bf = in.planes[3][i];
    const long double au = std::max(0.0L, 1 - ao - af), bu = std::max(0.0L, 1 - bo - bf);
    const long double o = ao * bo + ao * bu + au * bo, f = af * bf + af * bu + au * bf;
    const long double sum = o + f + au * bu;
    if (sum == 0) {
      EXPECT_EQ(got.o[i] + got.f[i], 0.0f);
      continue;
    }
    worst.mass =
        std::max({worst.mass, std::fabs(static_cast<double>(static_cast<long double>(got.o[i]) - o / sum)),
                  std::fabs(static_cast<double>(static_cast<long double>(got.f[i]) - f / sum))});
    worst.conflict = std::max(worst.conflict, static_cast<double>(ao * bf + af * bo));
    EXPECT_LE(got.o[i] + got.f[i], 1.0f);
  }
  return worst;
}

TEST(DempsterKernel, ErrsByAtMost2e7OnRandomMasses) {
  Random random(36);
  Worst worst;
  for (int round = 0; round < 400; ++round) {
    const Worst w = worst_error(plain_cells(8 * kBlock, random));
    worst = {std::max(worst.mass, w.mass), std::max(worst.conflict, w.conflict)};
  }
  EXPECT_LE(worst.mass, 2e-7) << "seed 36";
  EXPECT_GT(worst.conflict, 0.999999);
}

TEST(DempsterKernel, ErrsByAtMost2e7AtAnyConflict) {
  // One input says occupied but for p, the other free but for q: K = (1 - p)(1 - q) up to 1 - 1e-6 and
  // beyond. What is left of p and of q goes to the other hypothesis in part, so that all ratios of the three
  // small products are met.
  Random random(37);
  Worst worst;
  const auto small = [&] { return std::pow(10.0f, -8.0f * test::uniform(random)); };
  for (int round = 0; round < 400; ++round) {
    Pair in(8 * kBlock);
    for (std::size_t i = 0; i < in.cells(); ++i) {
      const float p = small(), q = small();
      const float o = 1.0f - p, f = 1.0f - q;
      const float other = random() % 3 == 0 ? 0.0f : (1.0f - o) * test::uniform(random);
      const float another = random() % 3 == 0 ? (1.0f - f) : (1.0f - f) * small();
      in.set(i, {o, other, another, f});
    }
    const Worst w = worst_error(in);
    worst = {std::max(worst.mass, w.mass), std::max(worst.conflict, w.conflict)};
  }
  RecordProperty("worst_error", std::to_string(worst.mass * 1e9) + "e-9");
  EXPECT_LE(worst.mass, 2e-7) << "seed 37";
  EXPECT_GT(worst.conflict, 1 - 1e-6);
}

}  // namespace
}  // namespace apgm

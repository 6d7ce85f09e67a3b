#include <algorithm>
#include <array>

#include "codec_body.hpp"

namespace apgm::format {
namespace {

/// Whole numbers of 1/levels that sum to `levels`: floors, then one more for the largest remainders.
void largest_remainders(std::span<const double> masses, std::uint32_t levels, std::span<std::uint32_t> out) {
  std::array<double, kMaxChannels + 1> rest{};
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < masses.size(); ++i) {
    const double exact = masses[i] * levels;
    out[i] = static_cast<std::uint32_t>(exact);
    rest[i] = exact - out[i];
    sum += out[i];
  }
  while (sum < levels) {
    const auto i = std::max_element(rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(masses.size())) -
                   rest.begin();
    ++out[static_cast<std::size_t>(i)];
    rest[static_cast<std::size_t>(i)] = -1;
    ++sum;
  }
  while (sum > levels) {  // masses that sum to slightly more than 1
    --*std::max_element(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(masses.size()));
    --sum;
  }
}

/// Cells `from` to `to` of any type.
void quantise_any(Layer& layer, const LayerType& type, std::size_t from, std::size_t to,
                  std::uint32_t levels) {
  const auto channels = static_cast<std::size_t>(layer.channels());
  const std::size_t parts = type.stores_omega() ? channels : channels + 1;
  std::array<double, kMaxChannels + 1> masses{};
  std::array<std::uint32_t, kMaxChannels + 1> whole{};
  for (std::size_t i = from; i < to; ++i) {
    double omega = 1;
    for (std::size_t c = 0; c < channels; ++c) {
      masses[c] = static_cast<double>(layer.plane(static_cast<int>(c))[i]);
      omega -= masses[c];
    }
    if (parts > channels) masses[channels] = std::max(0.0, omega);
    largest_remainders(std::span(masses).first(parts), levels, whole);
    for (std::size_t c = 0; c < channels; ++c) {
      layer.plane(static_cast<int>(c))[i] = static_cast<float>(whole[c]) / static_cast<float>(levels);
    }
  }
}

constexpr std::size_t kRun = 256;  // cells

/// The same for two channels beside m(Omega), without a branch in the loop: of three remainders either none,
/// the first of the largest, or all but the last of the smallest take one more.
/// @return  false, with nothing done, if a cell asks for more
bool quantise_pairs(Layer& layer, std::size_t from, std::size_t to, std::int32_t levels) {
  float* const a = layer.plane(0).data() + from;
  float* const b = layer.plane(1).data() + from;
  std::array<float, kRun> first, second;
  std::int32_t odd = 0;
  for (std::size_t i = 0; i < to - from; ++i) {
    const double x = static_cast<double>(a[i]), y = static_cast<double>(b[i]);
    const double omega = (1 - x) - y;
    const double p = x * levels, q = y * levels, r = (omega > 0 ? omega : 0) * levels;
    const auto m = static_cast<std::int32_t>(p), n = static_cast<std::int32_t>(q);
    const auto o = static_cast<std::int32_t>(r);
    const double rest_m = p - m, rest_n = q - n, rest_o = r - o;
    const std::int32_t missing = levels - m - n - o;
    const std::int32_t m_wins = (rest_m >= rest_n) & (rest_m >= rest_o);
    const std::int32_t n_wins = (rest_n > rest_m) & (rest_n >= rest_o);
    const std::int32_t m_loses = (rest_m < rest_n) & (rest_m < rest_o);
    const std::int32_t n_loses = (rest_n <= rest_m) & (rest_n < rest_o);
    const std::int32_t one = missing == 1, two = missing == 2;
    odd |= (missing < 0) | (missing > 2);
    first[i] = static_cast<float>(m + (one & m_wins) + (two & (1 ^ m_loses))) / static_cast<float>(levels);
    second[i] = static_cast<float>(n + (one & n_wins) + (two & (1 ^ n_loses))) / static_cast<float>(levels);
  }
  if (odd != 0) return false;
  std::copy_n(first.begin(), to - from, a);
  std::copy_n(second.begin(), to - from, b);
  return true;
}

}  // namespace

float error_bound(Lossy lossy) {
  switch (lossy) {
    case Lossy::kNone:
      return 0;
    case Lossy::kU16:
      return 1.0f / 65535.0f;
    case Lossy::kU8:
      return 1.0f / 255.0f;
  }
  return 0;
}

void quantise(Layer& layer, const LayerType& type, Lossy lossy) {
  if (lossy == Lossy::kNone || !type.is_evidence()) return;
  const std::uint32_t levels = lossy == Lossy::kU8 ? 255 : 65535;
  const bool pair = layer.channels() == 2 && !type.stores_omega();
  for (std::size_t from = 0; from < layer.cells(); from += kRun) {
    const std::size_t to = std::min(layer.cells(), from + kRun);
    if (!pair || !quantise_pairs(layer, from, to, static_cast<std::int32_t>(levels))) {
      quantise_any(layer, type, from, to, levels);
    }
  }
}

}  // namespace apgm::format

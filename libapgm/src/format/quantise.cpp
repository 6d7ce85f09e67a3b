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
  const auto channels = static_cast<std::size_t>(layer.channels());
  const std::size_t parts = type.stores_omega() ? channels : channels + 1;
  std::array<double, kMaxChannels + 1> masses{};
  std::array<std::uint32_t, kMaxChannels + 1> whole{};
  for (std::size_t i = 0; i < layer.cells(); ++i) {
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

}  // namespace apgm::format

#include "apgm/core/layer.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <new>
#include <string>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

constexpr float kMassSlack = 1e-6f;

[[noreturn]] void fail_mass(const LayerType& type, const char* what) {
  throw Error(ErrorCode::kInvalidArgument, "layer '" + type.name + "' holds " + what)
      .hint("masses lie in [0, 1] and sum to at most 1 in every cell");
}

/// Per plane: adds +0 (which turns -0 into +0) and tells whether all values lie in [0, 1]. NaN fails the
/// comparison.
bool clean_masses(std::span<float> plane) {
  int bad = 0;
  for (float& v : plane) {
    v += 0.0f;
    bad |= !(v >= 0.0f) | !(v <= 1.0f);
  }
  return bad == 0;
}

bool sums_valid(const Layer& layer, bool explicit_omega) {
  const float* planes[16];
  for (int c = 0; c < layer.channels(); ++c) planes[c] = layer.plane(c).data();
  const std::size_t n = layer.cells();
  const float low = explicit_omega ? 1.0f - kMassSlack : 0.0f;
  int bad = 0;
  if (layer.channels() == 2) {
    const float *p = planes[0], *q = planes[1];
    for (std::size_t i = 0; i < n; ++i) {
      const float sum = p[i] + q[i];
      bad |= (sum > 1.0f + kMassSlack) | (sum < low);
    }
    return bad == 0;
  }
  for (std::size_t i = 0; i < n; ++i) {
    float sum = 0;
    for (int c = 0; c < layer.channels(); ++c) sum += planes[c][i];
    bad |= (sum > 1.0f + kMassSlack) | (sum < low);
  }
  return bad == 0;
}

}  // namespace

void Layer::Free::operator()(float* p) const { std::free(p); }

Layer::Layer(const Layer& other) { *this = other; }

Layer& Layer::operator=(const Layer& other) {
  if (this == &other) return *this;
  reshape(other.channels_, other.step_);
  stamp_ns = other.stamp_ns;
  error_bound = other.error_bound;
  for (int c = 0; c < channels_; ++c)
    std::memcpy(plane(c).data(), other.plane(c).data(), cells() * sizeof(float));
  return *this;
}

Layer& Layer::operator=(Layer&& other) noexcept {
  data_ = std::move(other.data_);
  capacity_ = std::exchange(other.capacity_, 0);
  channels_ = std::exchange(other.channels_, 0);
  step_ = std::exchange(other.step_, 0);
  stamp_ns = std::exchange(other.stamp_ns, 0);
  error_bound = std::exchange(other.error_bound, 0.0f);
  return *this;
}

void Layer::reshape(int channels, int step) {
  if (step < 0 || step > kMaxStep) throw Error(ErrorCode::kLimit, "a resolution step lies in 0..11");
  assert(channels >= 0 && channels <= 16);
  const std::size_t cells = std::size_t{1} << (2 * step);
  if (cells * static_cast<std::size_t>(channels) * sizeof(float) > kMaxBytes) {
    throw Error(ErrorCode::kLimit, "a layer holds at most 64 MiB").hint("use fewer channels or a lower step");
  }
  const std::size_t wanted = (cells + 15) / 16 * 16 * static_cast<std::size_t>(channels);
  if (wanted > capacity_) {
    data_.reset();
    capacity_ = 0;
    auto* p = static_cast<float*>(std::aligned_alloc(64, wanted * sizeof(float)));
    if (p == nullptr) throw std::bad_alloc();
    data_.reset(p);
    capacity_ = wanted;
  }
  channels_ = channels;
  step_ = step;
  stamp_ns = 0;
  error_bound = 0;
}

void Layer::reset(const LayerType& type, int step) {
  reshape(static_cast<int>(type.channels.size()), step);
  for (int c = 0; c < channels_; ++c) std::ranges::fill(plane(c), type.background(c));
}

bool same_cells(const Layer& a, const Layer& b) {
  if (a.step() != b.step() || a.channels() != b.channels()) return false;
  for (int c = 0; c < a.channels(); ++c) {
    if (std::memcmp(a.plane(c).data(), b.plane(c).data(), a.cells() * sizeof(float)) != 0) return false;
  }
  return true;
}

bool is_vacuous(const Layer& layer, const LayerType& type) {
  for (int c = 0; c < layer.channels(); ++c) {
    const auto background = std::bit_cast<std::uint32_t>(type.background(c));
    const auto plane = layer.plane(c);
    // In blocks, so that the inner loop is branch-free and a layer with data is told early.
    for (std::size_t i = 0; i < plane.size(); i += 1024) {
      std::uint32_t differs = 0;
      const std::size_t end = std::min(plane.size(), i + 1024);
      for (std::size_t k = i; k < end; ++k) differs |= std::bit_cast<std::uint32_t>(plane[k]) ^ background;
      if (differs != 0) return false;
    }
  }
  return true;
}

void canonicalise(Layer& layer, const LayerType& type) {
  for (int c = 0; c < layer.channels(); ++c) {
    if (type.is_evidence()) {
      if (!clean_masses(layer.plane(c))) fail_mass(type, "a mass that is not a number in [0, 1]");
      continue;
    }
    for (float& v : layer.plane(c)) {
      if (std::isinf(v))
        throw Error(ErrorCode::kInvalidArgument, "layer '" + type.name + "' holds an infinite value");
      v = std::isnan(v) ? std::numeric_limits<float>::quiet_NaN() : v + 0.0f;
    }
  }
  if (type.is_evidence() && !sums_valid(layer, type.stores_omega())) {
    fail_mass(type, type.stores_omega() ? "masses that do not sum to 1" : "masses that sum to more than 1");
  }
}

bool is_canonical(const Layer& layer, const LayerType& type) {
  constexpr std::uint32_t kOne = 0x3f800000, kInfinity = 0x7f800000, kMinusZero = 0x80000000,
                          kQuietNan = 0x7fc00000;
  for (int c = 0; c < layer.channels(); ++c) {
    std::uint32_t bad = 0;
    if (type.is_evidence()) {
      // As unsigned numbers all of NaN, infinity, negatives, -0 and values above 1 lie beyond the bits of 1.
      for (const float v : layer.plane(c)) bad |= std::bit_cast<std::uint32_t>(v) > kOne;
    } else {
      for (const float v : layer.plane(c)) {
        const auto bits = std::bit_cast<std::uint32_t>(v);
        bad |= (bits == kMinusZero) | ((bits & kInfinity) == kInfinity && bits != kQuietNan);
      }
    }
    if (bad != 0) return false;
  }
  return !type.is_evidence() || sums_valid(layer, type.stores_omega());
}

}  // namespace apgm

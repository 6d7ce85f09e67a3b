#include "observe/observed_layers.hpp"

#include <algorithm>
#include <bit>

#include "apgm/core/budget.hpp"
#include "apgm/core/error.hpp"
#include "observe/grid_point.hpp"

namespace apgm::observe {
namespace {

/// Layers that no measurement has used for a while are freed beyond this.
constexpr std::uint64_t kMaxUnusedBytes = std::uint64_t{256} << 20;
/// A measurement of more patches that does not fit is not looked at to its end.
constexpr std::size_t kMaxCountedPatches = 65'536;

std::span<float> row_band(Layer& layer, int channel, RowRange rows) {
  const auto side = static_cast<std::size_t>(layer.side());
  const auto first = static_cast<std::size_t>(rows.begin) * side;
  return layer.plane(channel).subspan(first, static_cast<std::size_t>(rows.end) * side - first);
}

}  // namespace

void ObservedLayers::begin_measurement() {
  if (unused_bytes_ > kMaxUnusedBytes) free_unused();
  for (ObservedLayer& layer : layers_) recycle(std::move(layer));
  layers_.clear();
  by_patch_.clear();
  bytes_ = 0;
  has_last_ = false;
}

void ObservedLayers::free_unused() {
  for (auto& layers : unused_) layers.clear();
  unused_bytes_ = 0;
}

void ObservedLayers::trim(std::uint64_t most) {
  if (unused_bytes_ + bytes_ > most) free_unused();
  for (ObservedLayer& layer : layers_) {
    if (unused_bytes_ + layer.cells.value_bytes() <= most) recycle(std::move(layer));
  }
  layers_.clear();
  bytes_ = 0;
}

void ObservedLayers::clear_rows(ObservedLayer& layer) const {
  if (layer.rows.empty()) return;
  for (int c = 0; c < layer.cells.channels(); ++c) {
    std::ranges::fill(row_band(layer.cells, c, layer.rows), type_.background(c));
  }
}

void ObservedLayers::recycle(ObservedLayer&& layer) {
  clear_rows(layer);
  unused_bytes_ += layer.cells.value_bytes();
  unused_[static_cast<std::size_t>(layer.cells.step())].push_back(std::move(layer.cells));
}

int ObservedLayers::find(PatchIndex patch, const StepOf& step_of) {
  const std::uint64_t key = patch_key(patch);
  if (has_last_ && key == last_key_) return last_;
  const auto [known, is_new] = by_patch_.try_emplace(key, kUnwanted);
  if (is_new) {
    if (const std::optional<int> step = step_of(patch)) known->second = make(patch, *step);
  }
  last_key_ = key;
  last_ = known->second;
  has_last_ = true;
  return last_;
}

int ObservedLayers::make(PatchIndex patch, int step) {
  if (step < 0 || step > kMaxStep) throw Error(ErrorCode::kLimit, "a resolution step lies in 0..11");
  auto& unused = unused_[static_cast<std::size_t>(step)];
  bytes_ += type_.channels.size() * sizeof(float) << (2 * step);
  if (unused.empty() && bytes_ + unused_bytes_ > max_bytes_) free_unused();
  if (bytes_ > max_bytes_) {
    // The rest is only counted, to tell what all of it needs.
    if (bytes_ > Observer::kMaxBytes || by_patch_.size() > kMaxCountedPatches) check_size();
    return kUnwanted;
  }
  Layer layer;
  if (unused.empty()) {
    layer.reset(type_, step);
  } else {
    layer = std::move(unused.back());
    unused.pop_back();
    unused_bytes_ -= layer.value_bytes();
  }
  layers_.push_back({patch, {}, std::move(layer)});
  return static_cast<int>(layers_.size()) - 1;
}

void ObservedLayers::check_size() const {
  if (bytes_ <= max_bytes_) return;
  const std::string what =
      "one measurement fills more than " + std::to_string(max_bytes_ >> 20) + " MiB of cells";
  const std::string instead = "take larger cells or a shorter max_range_m";
  if (bytes_ > Observer::kMaxBytes) throw Error(ErrorCode::kLimit, what).hint(instead);
  throw over_budget(what, bytes_, instead);
}

bool ObservedLayers::has_data(const ObservedLayer& layer) const {
  const auto side = static_cast<std::size_t>(layer.cells.side());
  for (int c = 0; c < layer.cells.channels(); ++c) {
    const auto background = std::bit_cast<std::uint32_t>(type_.background(c));
    const auto plane = layer.cells.plane(c);
    for (int b = layer.rows.begin; b < layer.rows.end; ++b) {
      std::uint32_t differs = 0;
      for (const float v : plane.subspan(static_cast<std::size_t>(b) * side, side)) {
        differs |= std::bit_cast<std::uint32_t>(v) ^ background;
      }
      if (differs != 0) return true;
    }
  }
  return false;
}

std::span<const ObservedLayer> ObservedLayers::finish(std::int64_t stamp_ns) {
  const auto gone =
      std::partition(layers_.begin(), layers_.end(), [&](const ObservedLayer& l) { return has_data(l); });
  for (auto it = gone; it != layers_.end(); ++it) recycle(std::move(*it));
  layers_.erase(gone, layers_.end());
  for (ObservedLayer& layer : layers_) layer.cells.stamp_ns = stamp_ns;
  std::ranges::sort(layers_, {}, [](const ObservedLayer& l) { return curve_key(l.patch); });
  return layers_;
}

}  // namespace apgm::observe

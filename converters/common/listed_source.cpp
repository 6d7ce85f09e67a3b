#include "converters/common/listed_source.hpp"

#include <algorithm>
#include <utility>

#include "apgm/core/error.hpp"
#include "converters/common/file.hpp"

namespace apgm::converters {

class ListedSource::Cursor final : public PatchCursor {
 public:
  Cursor(const ListedSource& source, const std::optional<PatchRange>& range)
      : source_(source), range_(range) {}

  bool next(PatchInfo& out) override {
    while (at_ < source_.patches_.size()) {
      const PatchIndex patch = source_.patches_[at_++];
      if (range_ && !range_->contains(patch)) continue;
      out.patch = patch;
      out.layers.clear();
      source_.layers_of(patch, out.layers);
      return true;
    }
    return false;
  }

 private:
  const ListedSource& source_;
  std::optional<PatchRange> range_;
  std::size_t at_ = 0;
};

std::unique_ptr<PatchCursor> ListedSource::patches(const std::optional<PatchRange>& range) const {
  return std::make_unique<Cursor>(*this, range);
}

void ListedSource::list(std::vector<PatchIndex> patches) {
  // The key is worth computing once a patch, not once a comparison.
  std::vector<std::pair<std::uint64_t, PatchIndex>> keyed;
  keyed.reserve(patches.size());
  for (const PatchIndex patch : patches) keyed.emplace_back(curve_key(patch), patch);
  std::ranges::sort(keyed);
  for (std::size_t i = 0; i < keyed.size(); ++i) patches[i] = keyed[i].second;
  keyed = {};
  summary_ = Summary();
  summary_.types.resize(header_.types.size());
  std::vector<LayerInfo> layers;
  std::erase_if(patches, [&](PatchIndex patch) {
    layers.clear();
    layers_of(patch, layers);
    for (const LayerInfo& info : layers) {
      auto& of_type = summary_.types[info.type];
      ++of_type.layers;
      ++of_type.layers_at[info.step];
      of_type.raw_bytes += (std::uint64_t{4} << (2 * info.step)) * header_.types[info.type].channels.size();
    }
    if (!layers.empty()) summary_.range.add(patch);
    return layers.empty();
  });
  patches_ = std::move(patches);
  summary_.patches = patches_.size();
}

PatchMarks::PatchMarks(const PatchRange& range) : range_(range) {
  constexpr std::int64_t kMaxPatches = std::int64_t{1} << 22;
  if (range.empty()) return;
  width_ = std::int64_t{range.max.x} - range.min.x + 1;
  const std::int64_t height = std::int64_t{range.max.y} - range.min.y + 1;
  if (width_ > kMaxPatches / height) {
    throw Error(ErrorCode::kLimit, "the map covers more than 2^22 patches").hint("set a larger edge_m");
  }
  marks_.resize(static_cast<std::size_t>(width_ * height));
}

void PatchMarks::mark(const PatchRange& part) {
  for (std::int64_t y = part.min.y; y <= part.max.y; ++y) {
    const auto row = marks_.begin() + (y - range_.min.y) * width_ - range_.min.x;
    std::fill(row + part.min.x, row + part.max.x + 1, true);
  }
}

std::vector<PatchIndex> PatchMarks::marked(std::uint64_t max_memory_bytes) const {
  const auto count = static_cast<std::size_t>(std::ranges::count(marks_, true));
  // Each with its key while they are sorted.
  constexpr std::uint64_t kBytesAPatch = sizeof(PatchIndex) + sizeof(std::pair<std::uint64_t, PatchIndex>);
  check_budget(max_memory_bytes, count * kBytesAPatch, "the list of " + std::to_string(count) + " patches",
               "set a larger edge_m");
  std::vector<PatchIndex> patches;
  patches.reserve(count);
  for (std::size_t i = 0; i < marks_.size(); ++i) {
    if (!marks_[i]) continue;
    const auto at = static_cast<std::int64_t>(i);
    patches.push_back({static_cast<std::int32_t>(range_.min.x + at % width_),
                       static_cast<std::int32_t>(range_.min.y + at / width_)});
  }
  return patches;
}

}  // namespace apgm::converters

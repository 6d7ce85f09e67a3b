#include "shifted_source.hpp"

#include <algorithm>
#include <cassert>
#include <limits>
#include <tuple>

#include "apgm/core/error.hpp"
#include "apgm/fuse/resample.hpp"
#include "totals.hpp"

namespace apgm::ops {
namespace {

std::int32_t shifted_index(std::int64_t index) {
  if (index < std::numeric_limits<std::int32_t>::min() || index > std::numeric_limits<std::int32_t>::max()) {
    throw Error(ErrorCode::kLimit, "a patch would lie outside all patch indices after the datum's shift");
  }
  return static_cast<std::int32_t>(index);
}

PatchIndex moved(PatchIndex p, std::int64_t x, std::int64_t y) {
  return {shifted_index(p.x + x), shifted_index(p.y + y)};
}

}  // namespace

std::optional<CellOffset> whole_cells(const Frame& from, const Frame& to, int step) {
  assert(from.edge_um == to.edge_um);
  // At most 2e15 * 2^11: within 63 bits.
  const std::int64_t x = (from.datum_x_um - to.datum_x_um) * (std::int64_t{1} << step);
  const std::int64_t y = (from.datum_y_um - to.datum_y_um) * (std::int64_t{1} << step);
  if (x % from.edge_um != 0 || y % from.edge_um != 0) return {};
  return CellOffset{step, x / from.edge_um, y / from.edge_um};
}

class ShiftedCursor final : public PatchCursor {
 public:
  ShiftedCursor(const ShiftedSource& source, const std::optional<PatchRange>& range)
      : source_(source), range_(range) {}

  bool next(PatchInfo& out) override {
    const auto& parts = source_.plan().parts;
    while (at_ < parts.size()) {
      std::size_t end = at_ + 1;
      while (end < parts.size() && parts[end].key == parts[at_].key) ++end;
      const std::span group(parts.data() + at_, parts.data() + end);
      at_ = end;
      if (range_ && !range_->contains(group[0].target)) continue;
      source_.describe(group, out);
      return true;
    }
    return false;
  }

 private:
  const ShiftedSource& source_;
  std::optional<PatchRange> range_;
  std::size_t at_ = 0;
};

ShiftedSource::ShiftedSource(const PatchSource& source, const Frame& target, const CellOffset& offset)
    : source_(source), header_(source.header()), step_(offset.step) {
  header_.frame = target;
  const std::int64_t side = std::int64_t{1} << step_;
  patches_x_ = floor_div(offset.x, side);
  patches_y_ = floor_div(offset.y, side);
  cells_x_ = offset.x - patches_x_ * side;
  cells_y_ = offset.y - patches_y_ * side;
}

const ShiftedSource::Plan& ShiftedSource::plan() const {
  std::call_once(planned_, [this] { plan_ = make_plan(); });
  return plan_;
}

std::uint64_t ShiftedSource::plan_bytes() const {
  const Summary summary = source_.summary();
  std::uint64_t layers = 0;
  for (const Summary::OfType& type : summary.types) layers += type.layers;
  return layers * sizeof(LayerInfo) + (summary.patches + 1) * sizeof(std::size_t) +
         summary.patches * parts_per_patch() * sizeof(Part);
}

std::uint64_t ShiftedSource::working_bytes(std::uint64_t layer_bytes) const {
  return apgm::working_bytes(source_, layer_bytes) + (by_patches() ? 0 : 2 * layer_bytes);
}

/// Lists that grow would take up to thrice the memory; a file's own totals are not to be trusted with any.
void ShiftedSource::reserve(Plan& plan) const {
  std::size_t layers = 0, patches = 0;
  PatchInfo patch;
  for (const auto cursor = source_.patches(); cursor->next(patch); ++patches) layers += patch.layers.size();
  plan.layers.reserve(layers);
  plan.patches.reserve(patches + 1);
  plan.parts.reserve(patches * parts_per_patch());
}

ShiftedSource::Plan ShiftedSource::make_plan() const {
  Plan plan;
  PatchInfo patch;
  reserve(plan);
  const auto cursor = source_.patches();
  while (cursor->next(patch)) {
    const auto source = static_cast<std::uint32_t>(plan.patches.size());
    plan.patches.push_back(plan.layers.size());
    plan.layers.insert(plan.layers.end(), patch.layers.begin(), patch.layers.end());
    for (int dy = 0; dy <= (cells_y_ != 0); ++dy) {
      for (int dx = 0; dx <= (cells_x_ != 0); ++dx) {
        const PatchIndex target = moved(patch.patch, patches_x_ + dx, patches_y_ + dy);
        plan.parts.push_back({curve_key(target), target, source});
      }
    }
  }
  plan.patches.push_back(plan.layers.size());
  std::ranges::sort(plan.parts, [](const Part& a, const Part& b) {
    return std::tie(a.key, a.source) < std::tie(b.key, b.source);
  });
  return plan;
}

void ShiftedSource::describe(std::span<const Part> parts, PatchInfo& out) const {
  out.patch = parts[0].target;
  out.layers.clear();
  for (const Part& part : parts) {
    for (const LayerInfo& layer : plan_.layers_of(part.source)) {
      const auto it = std::ranges::lower_bound(out.layers, layer.type, {}, &LayerInfo::type);
      if (it != out.layers.end() && it->type == layer.type) {
        it->step = std::max(it->step, layer.step);
        it->stamp_ns = std::max(it->stamp_ns, layer.stamp_ns);
        continue;
      }
      LayerInfo info = layer;
      info.patch = out.patch;
      if (!by_patches()) {
        info.encoding = 0;
        info.stored_bytes = 0;
        info.content_hash = 0;
        info.locator = 0;
      }
      out.layers.insert(it, info);
    }
  }
}

Summary ShiftedSource::summary() const { return totals_of(*this); }

std::unique_ptr<PatchCursor> ShiftedSource::patches(const std::optional<PatchRange>& range) const {
  plan();
  return std::make_unique<ShiftedCursor>(*this, range);
}

bool ShiftedSource::load_stored(const LayerInfo& info, StoredLayer& out) const {
  if (!by_patches()) return false;
  LayerInfo original = info;
  original.patch = moved(info.patch, -patches_x_, -patches_y_);
  return source_.load_stored(original, out);
}

void ShiftedSource::load(const LayerInfo& info, Layer& out) const {
  if (by_patches()) {
    LayerInfo original = info;
    original.patch = moved(info.patch, -patches_x_, -patches_y_);
    source_.load(original, out);
    return;
  }
  const LayerType& type = header_.types[info.type];
  out.reset(type, info.step);
  Layer native, fine;
  const std::vector<Part>& parts = plan().parts;
  const std::uint64_t key = curve_key(info.patch);
  auto part = std::ranges::lower_bound(parts, key, {}, &Part::key);
  for (; part != parts.end() && part->key == key; ++part) {
    const auto layers = plan_.layers_of(part->source);
    const auto it = std::ranges::lower_bound(layers, info.type, {}, &LayerInfo::type);
    if (it == layers.end() || it->type != info.type) continue;
    source_.load(*it, native);
    if (it->step < info.step) resample(native, type, info.step, fine);
    place(it->step < info.step ? fine : native, it->patch, info.patch, out);
  }
  out.stamp_ns = info.stamp_ns;
}

void ShiftedSource::place(const Layer& layer, PatchIndex from, PatchIndex target, Layer& out) const {
  // Along an axis the first of two target patches takes cells [0, side - rest) at `rest`, the second the
  // others at 0.
  struct Run {
    std::int64_t from, to, count;
  };
  const std::int64_t side = layer.side();
  const auto run = [&](std::int64_t cells, std::int64_t patch_step) -> Run {
    const std::int64_t rest = cells << (layer.step() - step_);
    return patch_step == 0 ? Run{0, rest, side - rest} : Run{side - rest, 0, rest};
  };
  const Run x = run(cells_x_, target.x - from.x - patches_x_);
  const Run y = run(cells_y_, target.y - from.y - patches_y_);
  for (int c = 0; c < layer.channels(); ++c) {
    const auto in = layer.plane(c);
    const auto to = out.plane(c);
    for (std::int64_t b = 0; b < y.count; ++b) {
      const auto row = in.subspan(static_cast<std::size_t>((y.from + b) * side + x.from),
                                  static_cast<std::size_t>(x.count));
      std::ranges::copy(row, to.begin() + (y.to + b) * side + x.to);
    }
  }
}

}  // namespace apgm::ops

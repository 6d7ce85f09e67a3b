#include "converters/octomap/octree_source.hpp"

#include <cmath>
#include <string>

#include "apgm/core/error.hpp"
#include "converters/common/belief.hpp"
#include "converters/common/settings.hpp"

namespace apgm::converters {
namespace {

constexpr std::size_t kKeys = std::size_t{1} << kTreeDepth;

/// base^n by squaring: the same bits everywhere.
double power(double base, std::int64_t n) {
  double result = 1;
  for (; n > 0; n >>= 1, base *= base) {
    if ((n & 1) != 0) result *= base;
  }
  return result;
}

/// What the voxels of a column add up to.
struct Column {
  double not_occupied = 1;  // prod(1 - m(O))
  double free = 0;          // sum of m(F), which is phi: a voxel holds one of both masses
  std::int64_t known = 0;

  void add(Masses voxel, std::int64_t count) {
    not_occupied *= power(1 - static_cast<double>(voxel.occupied), count);
    free += static_cast<double>(voxel.free) * static_cast<double>(count);
    known += count;
  }
  Masses masses() const {
    if (known == 0) return {};
    const auto occupied = static_cast<float>(1 - not_occupied);
    const double rest = 1 - static_cast<double>(occupied);
    return {occupied, static_cast<float>(rest * (free / static_cast<double>(known)))};
  }
};

}  // namespace

LayerType slice_type(int z_key, double resolution_m) {
  std::string digits = std::to_string(z_key);
  digits.insert(0, 5 - digits.size(), '0');
  LayerType type = LayerType::occupancy("occupancy_z" + digits);
  const auto height_um = [&](int key) { return to_micrometres((key - kOriginKey) * resolution_m); };
  type.slab = Slab{height_um(z_key), height_um(z_key + 1)};
  return type;
}

OctreeSource::OctreeSource(std::unique_ptr<const ::octomap::OcTree> tree, const GridFit& fit, OctreeMode mode,
                           KeyRange heights, const Findings& findings, std::uint64_t max_memory_bytes)
    : tree_(std::move(tree)), fit_(fit), mode_(mode), heights_(heights) {
  header_.frame = fit.native;
  header_.metadata["octomap.resolution"] = format_number(tree_->getResolution());
  header_.metadata["octomap.mode"] = mode == OctreeMode::kSlices ? "slices" : "projection";
  describe(findings, max_memory_bytes);
}

OctreeSource::~OctreeSource() = default;

/// Finds the types and the patches, and reports what a belief cannot tell from no data.
void OctreeSource::describe(const Findings& findings, std::uint64_t max_memory_bytes) {
  const KeyBox all{{}, {}, heights_};
  PatchRange range;
  std::vector<bool> used(kKeys);
  std::int64_t undecided = 0;
  visit_leaves(*tree_, all, [&](const OctreeLeaf& leaf) {
    if (leaf.log_odds == 0) {
      undecided += leaf.box.x.size() * leaf.box.y.size() * leaf.box.z.size();
      return;
    }
    range.add(patches_of(leaf));
    std::fill(used.begin() + leaf.box.z.min, used.begin() + leaf.box.z.max, true);
  });
  if (undecided > 0 && findings) {
    findings({Finding::Kind::kLoss,
              std::to_string(undecided) + " known voxels of probability 0.5 become cells without data"});
  }

  std::vector<LayerType> types;
  if (mode_ == OctreeMode::kProjection) {
    types.push_back(LayerType::occupancy());
  } else {
    slice_types_.resize(kKeys);
    for (int key = heights_.min; key < heights_.max; ++key) {
      if (!used[static_cast<std::size_t>(key)]) continue;
      if (types.size() == TypeTable::kMaxTypes) {
        throw Error(ErrorCode::kLimit, "the octree has more than 4096 slices")
            .hint("limit the height with z_min and z_max, or use mode=projection");
      }
      slice_types_[static_cast<std::size_t>(key)] = static_cast<TypeId>(types.size());
      slice_keys_.push_back(key);
      types.push_back(slice_type(key, tree_->getResolution()));
    }
  }
  header_.types = TypeTable(std::move(types));

  PatchMarks marks(range);
  visit_leaves(*tree_, all, [&](const OctreeLeaf& leaf) {
    if (leaf.log_odds != 0) marks.mark(patches_of(leaf));
  });
  list(marks.marked(max_memory_bytes));
}

PatchRange OctreeSource::patches_of(const OctreeLeaf& leaf) const {
  return {fit_.cell_at(leaf.box.x.min - kOriginKey, leaf.box.y.min - kOriginKey).patch,
          fit_.cell_at(leaf.box.x.max - 1 - kOriginKey, leaf.box.y.max - 1 - kOriginKey).patch};
}

KeyBox OctreeSource::column_of(PatchIndex patch) const {
  const auto range = [&](std::int32_t index, std::int64_t offset) {
    const std::int64_t side = std::int64_t{1} << fit_.step;
    const std::int64_t first = index * side - offset + kOriginKey;
    constexpr std::int64_t kEnd = std::int64_t{1} << kTreeDepth;
    return KeyRange{static_cast<int>(std::clamp<std::int64_t>(first, 0, kEnd)),
                    static_cast<int>(std::clamp<std::int64_t>(first + side, 0, kEnd))};
  };
  return {range(patch.x, fit_.offset_x), range(patch.y, fit_.offset_y), heights_};
}

void OctreeSource::layers_of(PatchIndex patch, std::vector<LayerInfo>& out) const {
  LayerInfo info;
  info.patch = patch;
  info.step = static_cast<std::uint8_t>(fit_.step);
  if (mode_ == OctreeMode::kProjection) {
    out.push_back(info);
    return;
  }
  std::vector<bool> found(slice_keys_.size());
  visit_leaves(*tree_, column_of(patch), [&](const OctreeLeaf& leaf) {
    if (leaf.log_odds == 0) return;
    const auto first = found.begin() + slice_types_[static_cast<std::size_t>(leaf.box.z.min)];
    std::fill(first, first + leaf.box.z.size(), true);
  });
  for (std::size_t type = 0; type < found.size(); ++type) {
    if (!found[type]) continue;
    info.type = static_cast<TypeId>(type);
    out.push_back(info);
  }
}

/// Columns take thrice what a layer's two floats a cell take.
std::uint64_t OctreeSource::working_bytes(std::uint64_t layer_bytes) const {
  static_assert(sizeof(Column) == 3 * 2 * sizeof(float));
  return mode_ == OctreeMode::kProjection ? 3 * layer_bytes : 0;
}

void OctreeSource::load(const LayerInfo& info, Layer& out) const {
  out.reset(header_.types[info.type], fit_.step);
  if (mode_ == OctreeMode::kProjection) {
    load_projection(info.patch, out);
  } else {
    load_slice(info.patch, slice_keys_[info.type], out);
  }
}

void OctreeSource::load_slice(PatchIndex patch, int z_key, Layer& out) const {
  KeyBox box = column_of(patch);
  box.z = {z_key, z_key + 1};
  visit_leaves(*tree_, box, [&](const OctreeLeaf& leaf) {
    const Masses masses = masses_from_log_odds(leaf.log_odds);
    for (int y = leaf.box.y.min; y < leaf.box.y.max; ++y) {
      for (int x = leaf.box.x.min; x < leaf.box.x.max; ++x) {
        const CellIndex cell = fit_.cell_at(x - kOriginKey, y - kOriginKey).cell;
        out.at(0, cell) = masses.occupied;
        out.at(1, cell) = masses.free;
      }
    }
  });
}

void OctreeSource::load_projection(PatchIndex patch, Layer& out) const {
  std::vector<Column> columns(out.cells());
  visit_leaves(*tree_, column_of(patch), [&](const OctreeLeaf& leaf) {
    if (leaf.log_odds == 0) return;
    const Masses masses = masses_from_log_odds(leaf.log_odds);
    for (int y = leaf.box.y.min; y < leaf.box.y.max; ++y) {
      for (int x = leaf.box.x.min; x < leaf.box.x.max; ++x) {
        const CellIndex cell = fit_.cell_at(x - kOriginKey, y - kOriginKey).cell;
        columns[static_cast<std::size_t>(cell.b * out.side() + cell.a)].add(masses, leaf.box.z.size());
      }
    }
  });
  const auto occupied = out.plane(0), free = out.plane(1);
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const Masses masses = columns[i].masses();
    occupied[i] = masses.occupied;
    free[i] = masses.free;
  }
}

}  // namespace apgm::converters

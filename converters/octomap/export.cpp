#include "converters/octomap/export.hpp"

#include <octomap/OcTree.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "apgm/fuse/regrid.hpp"
#include "apgm/fuse/resample.hpp"
#include "converters/common/belief.hpp"
#include "converters/common/choose.hpp"
#include "converters/common/file.hpp"
#include "converters/octomap/octree_walk.hpp"

namespace apgm::converters {
namespace {

/// The map's cells in the octree's keys.
struct KeyGrid {
  int step = 0;
  double resolution_m = 0;
  std::int64_t x = 0, y = 0;  ///< key of the datum's cell
};

/// The resolution a tree was imported with, if the frame is still its own; else the cell size.
double resolution_of(const MapHeader& header, int step) {
  const auto it = header.metadata.find("octomap.resolution");
  if (it != header.metadata.end()) {
    const auto stored = parse_number(it->second);
    const double edge_um = stored ? std::ldexp(*stored, step) * 1e6 : 0;
    if (std::fabs(edge_um - static_cast<double>(header.frame.edge_um)) <= 0.501) return *stored;
  }
  return static_cast<double>(header.frame.edge_um) / 1e6 / (1 << step);
}

std::optional<std::int64_t> whole_cells(std::int64_t distance_um, std::int64_t edge_um, int step) {
  const __int128 scaled = static_cast<__int128>(distance_um) << step;
  if (scaled % edge_um != 0) return {};
  return static_cast<std::int64_t>(scaled / edge_um);
}

/// Voxels whose centre lies in the slab; the one that holds its middle if there are none.
KeyRange keys_of(const Slab& slab, double resolution_m) {
  const auto scaled = [&](std::int64_t um) { return static_cast<double>(um) * 1e-6 / resolution_m; };
  const double low = std::ceil(scaled(slab.z_min_um) - 0.5 - 1e-4) + kOriginKey;
  const double high = std::ceil(scaled(slab.z_max_um) - 0.5 - 1e-4) + kOriginKey;
  const double middle = std::floor((scaled(slab.z_min_um) + scaled(slab.z_max_um)) / 2) + kOriginKey;
  const double first = high > low ? low : middle, end = high > low ? high : middle + 1;
  if (first < 0 || end > (1 << kTreeDepth)) {
    throw Error(ErrorCode::kLimit, "heights lie outside the octree, which reaches 32768 voxels up and down");
  }
  return {static_cast<int>(first), static_cast<int>(end)};
}

/// Heights of a layer without any: z_min and z_max, one voxel where only one of them is given.
Slab slab_of(const SettingsReader& settings, double resolution_m) {
  const auto z_min = settings.number("z_min"), z_max = settings.number("z_max");
  const double low = z_min ? *z_min : z_max ? *z_max - resolution_m : 0;
  const double high = z_max ? *z_max : low + resolution_m;
  if (low >= high) settings.refuse("z_min", "is not below z_max");
  return {to_micrometres(low), to_micrometres(high)};
}

/// Builds the tree voxel by voxel and counts what it cannot hold.
class TreeBuilder {
 public:
  /// @param max_bytes  bound of the tree's memory; 0: none
  TreeBuilder(const KeyGrid& grid, bool binary, std::uint64_t max_bytes)
      : tree_(grid.resolution_m), grid_(grid), binary_(binary), max_bytes_(max_bytes) {
    extremes_[0] = masses_from_log_odds(tree_.getClampingThresMinLog());
    extremes_[1] = masses_from_log_odds(tree_.getClampingThresMaxLog());
    if (binary_) return;
    tree_.setClampingThresMin(0.0);
    tree_.setClampingThresMax(1.0);
  }

  void add(PatchIndex patch, const Layer& layer, KeyRange heights) {
    const auto occupied = layer.plane(0), free = layer.plane(1);
    for (std::size_t i = 0; i < layer.cells(); ++i) {
      const Masses masses{occupied[i], free[i]};
      if (masses == Masses{}) continue;
      const auto a = static_cast<std::int64_t>(i) & (layer.side() - 1);
      const auto b = static_cast<std::int64_t>(i) >> grid_.step;
      set(key(grid_.x + (std::int64_t{patch.x} << grid_.step) + a),
          key(grid_.y + (std::int64_t{patch.y} << grid_.step) + b), heights, value_of(masses));
    }
  }

  const ::octomap::OcTree& finish() {
    tree_.updateInnerOccupancy();
    tree_.prune();
    return tree_;
  }

  std::uint64_t rounded = 0;  ///< cells whose probability became an extreme (.bt)
  std::uint64_t mixed = 0;    ///< cells with evidence for both hypotheses

 private:
  static constexpr std::uint64_t kMaxVoxels = std::uint64_t{1} << 30;

  static ::octomap::key_type key(std::int64_t k) {
    if (k < 0 || k >= (1 << kTreeDepth)) {
      throw Error(ErrorCode::kLimit, "known cells lie outside the octree, which reaches 32768 cells each way")
          .hint("set origin=X,Y to a point inside the map, or crop the map");
    }
    return static_cast<::octomap::key_type>(k);
  }

  float value_of(Masses masses) {
    mixed += masses.occupied > 0 && masses.free > 0;
    const float l = log_odds(masses);
    if (!binary_) return l;
    rounded += masses != extremes_[0] && masses != extremes_[1];
    return l >= 0 ? tree_.getClampingThresMaxLog() : tree_.getClampingThresMinLog();
  }

  /// Before `more` voxels are set. Those that are set are the leaves, until the tree is pruned; each that is
  /// new may need a way of its own down from the root.
  void check_memory(std::uint64_t more) const {
    const std::uint64_t now =
        octree_memory(tree_.size(), tree_.size() - std::min<std::uint64_t>(voxels_, tree_.size()));
    const std::uint64_t next = octree_memory(more * kTreeDepth, more * kTreeDepth);
    if (now + next <= max_bytes_) return;
    throw Error(ErrorCode::kLimit, "an octree is built in memory as a whole, and that takes more than " +
                                       std::to_string(max_bytes_ >> 20) + " MiB")
        .hint("how much shows on the way only: raise --max-memory, crop the map, or choose a thinner slab");
  }

  void set(::octomap::key_type x, ::octomap::key_type y, KeyRange heights, float value) {
    if (max_bytes_ != 0) check_memory(static_cast<std::uint64_t>(heights.size()));
    voxels_ += static_cast<std::uint64_t>(heights.size());
    if (voxels_ > kMaxVoxels) {
      throw Error(ErrorCode::kLimit,
                  "the octree would have more than " + std::to_string(kMaxVoxels) + " voxels")
          .hint("an octree is built in memory: crop the map, or choose a thinner slab");
    }
    for (int z = heights.min; z < heights.max; ++z) {
      tree_.setNodeValue(::octomap::OcTreeKey(x, y, static_cast<::octomap::key_type>(z)), value, true);
    }
  }

  ::octomap::OcTree tree_;
  KeyGrid grid_;
  bool binary_;
  std::uint64_t max_bytes_;
  std::uint64_t voxels_ = 0;
  Masses extremes_[2];
};

std::map<TypeId, KeyRange> heights_of(const TypeTable& types, const std::vector<TypeId>& chosen,
                                      const SettingsReader& settings, double resolution_m) {
  std::map<TypeId, KeyRange> heights;
  std::vector<std::pair<KeyRange, TypeId>> taken;
  for (const TypeId type : chosen) {
    const auto& slab = types[type].slab;
    if (slab && (settings.has("z_min") || settings.has("z_max"))) {
      settings.refuse(settings.has("z_min") ? "z_min" : "z_max",
                      "does not apply: layer '" + types[type].name + "' has its own height");
    }
    heights[type] = keys_of(slab ? *slab : slab_of(settings, resolution_m), resolution_m);
    taken.emplace_back(heights[type], type);
  }
  std::ranges::sort(taken, {}, [](const auto& t) { return t.first.min; });
  for (std::size_t i = 1; i < taken.size(); ++i) {
    if (taken[i].first.min >= taken[i - 1].first.max) continue;
    throw Error(ErrorCode::kIncompatible, "layers '" + types[taken[i - 1].second].name + "' and '" +
                                              types[taken[i].second].name + "' share voxels of one height")
        .hint("choose one with --layer");
  }
  return heights;
}

std::vector<TypeId> choose_layers(const PatchSource& source, const std::string& name) {
  std::vector<TypeId> slices;
  const TypeTable& types = source.header().types;
  for (std::size_t i = 0; i < types.size(); ++i) {
    const auto type = static_cast<TypeId>(i);
    if (types[type].is_occupancy() && types[type].slab) slices.push_back(type);
  }
  if (name.empty() && !slices.empty()) return slices;
  const auto one = choose_occupancy(source, name);
  return one ? std::vector<TypeId>{*one} : std::vector<TypeId>{};
}

void fill(const PatchSource& source, const std::map<TypeId, KeyRange>& heights, int step,
          TreeBuilder& builder, const RunOptions& run) {
  const std::uint64_t total = source.summary().patches;
  const auto cursor = source.patches();
  PatchInfo patch;
  Layer layer, fine;
  for (std::uint64_t done = 0; cursor->next(patch); ++done) {
    check_cancelled(run);
    for (const LayerInfo& info : patch.layers) {
      const auto height = heights.find(info.type);
      if (height == heights.end()) continue;
      source.load(info, layer);
      if (layer.step() != step) resample(layer, source.header().types[info.type], step, fine);
      builder.add(patch.patch, layer.step() == step ? layer : fine, height->second);
    }
    if (run.progress) run.progress(done + 1, total);
  }
}

void report(const TreeBuilder& builder, bool binary, const Findings& findings) {
  if (!findings) return;
  if (binary && builder.rounded > 0) {
    findings({Finding::Kind::kLoss,
              std::to_string(builder.rounded) +
                  " cells keep only whether they are occupied or free; .ot keeps probabilities"});
  }
  if (builder.mixed > 0) {
    findings({Finding::Kind::kLoss, std::to_string(builder.mixed) +
                                        " cells with both occupied and free evidence keep only BetP(O)"});
  }
}

void export_aligned(const PatchSource& source, std::int64_t x, std::int64_t y, int step,
                    const std::vector<TypeId>& chosen, const WriteRequest& request,
                    const SettingsReader& settings, OutputFile& file) {
  const bool binary = extension_of(request.path) == ".bt";
  const KeyGrid grid{step, resolution_of(source.header(), step), x + kOriginKey, y + kOriginKey};
  const std::uint64_t budget = request.run.max_memory_bytes;
  const std::uint64_t reading = reading_bytes(source, chosen, step);
  check_budget(budget, reading, "one patch at work");
  TreeBuilder builder(grid, binary, budget_left(budget, reading));
  fill(source, heights_of(source.header().types, chosen, settings, grid.resolution_m), step, builder,
       request.run);
  write_octree(builder.finish(), binary, file);
  report(builder, binary, request.run.findings);
}

}  // namespace

void export_octree(const PatchSource& source, const WriteRequest& request, const SettingsReader& settings) {
  const std::string extension = extension_of(request.path);
  if (extension != ".bt" && extension != ".ot") {
    throw Error(ErrorCode::kInvalidArgument, "'" + request.path + "' does not end in .bt or .ot")
        .hint("the extension says whether the octree holds probabilities (.ot) or not (.bt)");
  }
  const Point origin = settings.point("origin").value_or(Point{});
  const std::vector<TypeId> chosen = choose_layers(source, request.layer);
  const int step = finest_step(source.summary(), chosen);
  OutputFile file(request.path, request.output);

  Frame frame = source.header().frame;
  const std::int64_t origin_x = to_micrometres(origin.x_m), origin_y = to_micrometres(origin.y_m);
  const auto x = whole_cells(frame.datum_x_um - origin_x, frame.edge_um, step);
  const auto y = whole_cells(frame.datum_y_um - origin_y, frame.edge_um, step);
  if (x && y) {
    export_aligned(source, *x, *y, step, chosen, request, settings, file);
  } else {
    const Summary summary = source.summary();
    const bool any = std::ranges::any_of(chosen, [&](TypeId type) { return summary.types[type].layers > 0; });
    if (any && request.run.findings) {
      request.run.findings(
          {Finding::Kind::kLoss, "the octree's origin lies between cells: the map is regridded"});
    }
    frame.datum_x_um = origin_x;
    frame.datum_y_um = origin_y;
    const auto moved = regrid(source, frame, {}, step);
    export_aligned(*moved, 0, 0, step, chosen, request, settings, file);
  }
  report_left_out(source, chosen, request.run.findings);
  file.commit();
}

}  // namespace apgm::converters

#include "tools/common/layout_foreign.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>

#include "apgm/core/budget.hpp"
#include "apgm/core/error.hpp"
#include "converters/common/choose.hpp"
#include "converters/common/converter.hpp"
#include "converters/common/settings.hpp"
#include "tools/common/layout_memory.hpp"
#include "tools/common/report.hpp"
#ifdef APGM_HAS_OCTOMAP
#include "converters/octomap/octree_size.hpp"
#endif

namespace apgm::tools {
namespace {

namespace fs = std::filesystem;
using converters::Converter;
using converters::Settings;

constexpr std::uint64_t kUsualOctreeBytes = std::uint64_t{4} << 30;
/// Dense arrays take the whole extent of the map, however little of it is known.
constexpr double kMostArrayBytes = 1 << 30;
constexpr double kMostBytes = 1e18;

/// Gone with all in it.
class Directory {
 public:
  Directory() {
    std::error_code error;
    std::string name = (fs::temp_directory_path(error) / "apgm-compare-XXXXXX").string();
    if (error || ::mkdtemp(name.data()) == nullptr) {
      throw Error(ErrorCode::kOutput, "cannot make a temporary directory '" + name + "'")
          .hint("TMPDIR names where temporary files lie");
    }
    path_ = name;
  }
  ~Directory() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  Directory(const Directory&) = delete;
  Directory& operator=(const Directory&) = delete;

  std::string file(const std::string& name) const { return (path_ / name).string(); }
  /// Bytes of all files, which are then removed.
  std::uint64_t take_bytes() const {
    std::uint64_t bytes = 0;
    for (const auto& entry : fs::directory_iterator(path_)) {
      bytes += entry.file_size();
      fs::remove(entry.path());
    }
    return bytes;
  }
  /// A message without the directory's name, which differs from run to run.
  std::string plain(std::string text) const {
    const std::string prefix = path_.string() + "/";
    for (std::size_t at = 0; (at = text.find(prefix)) != std::string::npos;) text.erase(at, prefix.size());
    return text;
  }

 private:
  fs::path path_;
};

class ForeignFormats {
 public:
  ForeignFormats(const Map& map, const CompareOptions& options) : map_(map), options_(options) {
    run_.threads = options.run.threads;
    run_.cancel = options.run.cancel;
  }

  std::vector<LayoutRow> rows() {
    std::vector<LayoutRow> rows;
    for (const char* extension : {"ot", "bt"}) {
      rows.push_back(
          row(std::string("octomap-") + extension, "octomap",
              [&](const Converter& c, LayoutRow& to) { octree(c, std::string("map.") + extension, to); }));
    }
    rows.push_back(row("geotiff", "geotiff", [&](const Converter& c, LayoutRow& to) { rasters(c, to); }));
    rows.push_back(row("numpy", "numpy", [&](const Converter& c, LayoutRow& to) { arrays(c, to); }));
    return rows;
  }

 private:
  using Fill = std::function<void(const Converter&, LayoutRow&)>;

  LayoutRow row(const std::string& name, const char* format, const Fill& fill) const {
    LayoutRow row;
    row.layout = name;
    row.in_memory = false;
    const Converter* converter = converters::find(format);
    if (converter == nullptr) {
      row.note = "not in this build";
      return row;
    }
    try {
      fill(*converter, row);
      return row;
    } catch (const Error& error) {
      const ErrorCode code = error.code();
      if (code != ErrorCode::kLimit && code != ErrorCode::kInvalidArgument &&
          code != ErrorCode::kIncompatible && code != ErrorCode::kUnsupported) {
        throw;
      }
      directory_.take_bytes();
      LayoutRow none;
      none.layout = name;
      none.in_memory = false;
      none.note = directory_.plain(error.message());
      return none;
    }
  }

  std::string write(const Converter& converter, const std::string& name, const std::string& layer,
                    const Settings& settings, std::uint64_t usual_budget = 0) const {
    const std::string path = directory_.file(name);
    converters::WriteRequest request{path, layer, settings, {}, run_};
    request.run.max_memory_bytes = options_.memory_left ? options_.memory_left() : usual_budget;
    converter.write(map_, request);
    return path;
  }

  /// A map on the patches of the own one that what is read back goes into.
  Map nothing_yet() const {
    MapHeader header;
    header.frame = map_.header().frame;
    header.types = map_.header().types;
    return Map(std::move(header));
  }

  /// @param as     name of the type that the only one that is read stands for; empty: types keep their names
  /// @param shift  of the indices of patches
  void read(const Converter& converter, const std::string& path, const Settings& settings,
            const std::string& as, PatchIndex shift, Map& back, std::uint64_t usual_budget = 0) const {
    const auto source = converter.open({path, settings, {}, beside_back(usual_budget)});
    if (source->header().frame.edge_um != back.header().frame.edge_um) {
      throw Error(ErrorCode::kIncompatible, "cells that come back do not fit the map's patches");
    }
    const auto cursor = source->patches();
    PatchInfo patch;
    Layer layer;
    while (cursor->next(patch)) {
      converters::check_cancelled(run_);
      for (const LayerInfo& info : patch.layers) {
        const auto id = back.header().types.find(as.empty() ? source->header().types[info.type].name : as);
        const PatchIndex at{patch.patch.x + shift.x, patch.patch.y + shift.y};
        if (!id || map_.find(at, *id) == nullptr) continue;
        source->load(info, layer);
        back.layer(at, *id, layer.step()) = std::move(layer);
      }
    }
  }

  /// What a reader may take while the map that it gives back grows.
  std::uint64_t beside_back(std::uint64_t usual_budget) const {
    if (!options_.memory_left) return usual_budget;
    const std::uint64_t left = options_.memory_left();
    const auto back = static_cast<std::uint64_t>(
        std::min(LayoutMemory::back_bytes(map_, options_.finest_cell_m), kMostBytes));
    check_budget(left, back, "the memory budget does not hold what comes back");
    return std::max<std::uint64_t>(left - back, 1);
  }

  void octree(const Converter& converter, const std::string& name, LayoutRow& row) const {
    const TypeTable& types = map_.header().types;
    std::vector<TypeId> slices;
    for (std::size_t i = 0; i < types.size(); ++i) {
      const auto id = static_cast<TypeId>(i);
      if (types[id].is_occupancy() && types[id].slab) slices.push_back(id);
    }
    const auto flat = slices.empty() ? converters::choose_occupancy(map_, "") : std::nullopt;
    if (slices.empty() && !flat) throw Error(ErrorCode::kIncompatible, "the map holds no occupancy");
    // A tree reaches 32768 cells each way from its origin, which is why that lies amid the map.
    const PatchRange range = map_.summary().range;
    const auto middle = [](std::int64_t a, std::int64_t b) { return static_cast<std::int32_t>((a + b) / 2); };
    const PatchIndex centre{middle(range.min.x, range.max.x), middle(range.min.y, range.max.y)};
    const Point origin = map_.header().frame.origin_m(centre);
    const std::string path = write(
        converter, name, "",
        {{"origin", converters::format_number(origin.x_m) + "," + converters::format_number(origin.y_m)}},
        kUsualOctreeBytes);
#ifdef APGM_HAS_OCTOMAP
    const auto size =
        converters::octree_size(path, options_.memory_left ? options_.memory_left() : kUsualOctreeBytes);
    row.in_memory = true;
    row.values_per_cell = 1;
    row.footprint = {size.leaves, size.leaves, size.leaves, size.bytes};
#endif
    if (options_.change) {
      Map back = nothing_yet();
      read(converter, path,
           {{"mode", slices.empty() ? "projection" : "slices"},
            {"edge_m", converters::format_number(map_.header().frame.edge_m())}},
           flat ? types[*flat].name : "", centre, back, kUsualOctreeBytes);
      row.change = belief_change(back, map_);
    }
    row.disk_bytes = directory_.take_bytes();
  }

  void rasters(const Converter& converter, LayoutRow& row) const {
    const TypeTable& types = map_.header().types;
    const Summary summary = map_.summary();
    Map back = nothing_yet();
    row.disk_bytes = 0;
    for (std::size_t i = 0; i < types.size(); ++i) {
      if (summary.types[i].layers == 0) continue;
      const LayerType& type = types[static_cast<TypeId>(i)];
      const std::string path = write(converter, fmt::format("{}.tif", i), type.name, {});
      if (options_.change && type.is_evidence()) {
        read(converter, path, {{"allow_no_crs", "1"}}, type.name, {}, back);
      }
      *row.disk_bytes += directory_.take_bytes();
    }
    if (options_.change) row.change = belief_change(back, map_);
  }

  void arrays(const Converter& converter, LayoutRow& row) const {
    if (const double bytes = array_bytes(); bytes > kMostArrayBytes) {
      throw Error(ErrorCode::kLimit,
                  fmt::format("arrays over the whole extent would take {}: not written",
                              size_text(static_cast<std::uint64_t>(std::min(bytes, 1e18)))));
    }
    const std::string path = write(converter, "map.npz", "", {});
    if (options_.change) {
      Map back = nothing_yet();
      read(converter, path, {}, "", {}, back);
      row.change = belief_change(back, map_);
    }
    row.disk_bytes = directory_.take_bytes();
  }

  /// At most: an array for each type and step over the extent of all patches.
  double array_bytes() const {
    const Summary summary = map_.summary();
    const double patches = (static_cast<double>(summary.range.max.x) - summary.range.min.x + 1) *
                           (static_cast<double>(summary.range.max.y) - summary.range.min.y + 1);
    double bytes = 0;
    for (std::size_t i = 0; i < summary.types.size(); ++i) {
      const auto channels = static_cast<double>(map_.header().types[static_cast<TypeId>(i)].channels.size());
      for (int step = 0; step <= kMaxStep; ++step) {
        if (summary.types[i].layers_at[static_cast<std::size_t>(step)] == 0) continue;
        bytes += std::ldexp(patches * channels * sizeof(float), 2 * step);
      }
    }
    return bytes;
  }

  const Map& map_;
  const CompareOptions& options_;
  RunOptions run_;
  Directory directory_;
};

}  // namespace

std::vector<LayoutRow> foreign_rows(const Map& map, const CompareOptions& options) {
  return ForeignFormats(map, options).rows();
}

}  // namespace apgm::tools

#include "converters/geotiff/export.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>

#include "apgm/fuse/resample.hpp"
#include "converters/common/choose.hpp"
#include "converters/common/file.hpp"
#include "converters/geotiff/legend_file.hpp"
#include "converters/geotiff/tags.hpp"
#include "converters/geotiff/tiff_file.hpp"
#include "converters/geotiff/tile_grid.hpp"

namespace apgm::converters {
namespace {

constexpr std::array<std::string_view, 2> kModes{"masses", "classes"};
constexpr std::array<std::string_view, 3> kCompressions{"zstd", "deflate", "none"};

std::optional<int> whole(const SettingsReader& settings, const std::string& key, int low, int high) {
  const auto number = settings.number(key, low, high);
  if (number && *number != std::floor(*number)) settings.refuse(key, "is not a whole number");
  return number ? std::optional<int>(static_cast<int>(*number)) : std::nullopt;
}

/// The layer that is written: the one named, else `occupancy`, else the only one.
std::optional<TypeId> choose_layer(const PatchSource& source, const std::string& name) {
  const TypeTable& types = source.header().types;
  if (!name.empty()) {
    if (const auto named = types.find(name)) return named;
    throw Error(ErrorCode::kInvalidArgument, "the map has no layer '" + name + "'");
  }
  const Summary summary = source.summary();
  std::vector<TypeId> filled;
  std::string names;
  for (std::size_t i = 0; i < types.size(); ++i) {
    const auto id = static_cast<TypeId>(i);
    if (summary.types[i].layers == 0) continue;
    if (types[id].name == "occupancy") return id;
    filled.push_back(id);
    if (filled.size() <= 8) names += (names.empty() ? "" : ", ") + types[id].name;
  }
  if (filled.size() == 1) return filled[0];
  if (filled.empty() && !types.empty()) return types.find("occupancy").value_or(TypeId{0});
  if (filled.empty()) return {};
  throw Error(ErrorCode::kInvalidArgument, "the map has several layers, and a GeoTIFF holds one")
      .hint("choose one with --layer: " + names + (filled.size() > 8 ? ", ..." : ""));
}

/// Takes the cells of a layer to the pixels of the raster's bands, and counts what they cannot hold.
class Painter {
 public:
  Painter(const LayerType& type, bool classes, std::optional<double> class_mass)
      : type_(type), classes_(classes) {
    if (class_mass) class_mass_ = static_cast<float>(*class_mass);
  }

  int bands() const { return classes_ ? 1 : static_cast<int>(type_.channels.size()); }

  void paint(const Layer& layer, std::size_t cell, std::span<float> out) {
    bool nothing = true;
    for (int c = 0; c < layer.channels(); ++c) {
      const float v = layer.plane(c)[cell], background = type_.background(c);
      values_[static_cast<std::size_t>(c)] = v;
      nothing = nothing && (std::isnan(background) ? std::isnan(v) : v == background);
    }
    const std::span<const float> values(values_.data(), type_.channels.size());
    if (classes_) {
      out[0] = nothing ? 0 : static_cast<float>(1 + class_of(values));
      return;
    }
    if (!nothing && !type_.is_evidence()) {
      without_number += std::ranges::all_of(values, [](float v) { return std::isnan(v); });
    }
    for (std::size_t c = 0; c < values.size(); ++c) {
      out[c] = nothing ? std::numeric_limits<float>::quiet_NaN() : values[c];
    }
  }

  std::uint64_t graded = 0;          ///< cells whose masses a class does not tell
  std::uint64_t without_number = 0;  ///< counts that are NaN

 private:
  /// The hypothesis of the greatest BetP, the first of equals: that of the greatest mass.
  std::size_t class_of(std::span<const float> values) {
    const auto masses = values.first(type_.hypotheses.size());
    const auto k = static_cast<std::size_t>(std::ranges::max_element(masses) - masses.begin());
    bool told = class_mass_ && masses[k] == *class_mass_;
    for (std::size_t c = 0; c < masses.size(); ++c) told = told && (c == k || masses[c] == 0);
    if (type_.stores_omega()) told = told && class_mass_ && values.back() == 1.0f - *class_mass_;
    graded += !told;
    return k;
  }

  const LayerType& type_;
  bool classes_;
  std::optional<float> class_mass_;
  std::array<float, 16> values_{};
};

/// Writes all tiles of a type, from north to south, units of tiles and patches at a time.
class TileWriter {
 public:
  TileWriter(const PatchSource& source, TypeId type, const TileGrid& grid, Painter& painter, TiffFile& file,
             bool bytes, const RunOptions& run)
      : source_(source), type_(type), grid_(grid), painter_(painter), file_(file), bytes_(bytes), run_(run) {
    const auto pixels = static_cast<std::size_t>(grid.unit) * static_cast<std::size_t>(grid.unit);
    unit_.resize(pixels * static_cast<std::size_t>(painter.bands()));
    tile_.resize(static_cast<std::size_t>(grid.tile) * static_cast<std::size_t>(grid.tile));
  }

  void write_all() {
    total_ = source_.summary().types[type_].layers;
    for (std::int64_t row = 0; row < grid_.unit_rows(); ++row) write_row(row);
  }

  std::uint64_t split = 0, merged = 0;  ///< layers brought to the raster's step

 private:
  void write_row(std::int64_t row) {
    std::map<std::int64_t, std::vector<LayerInfo>> columns;
    const auto cursor = source_.patches(grid_.patches_of_row(row));
    PatchInfo patch;
    while (cursor->next(patch)) {
      for (const LayerInfo& info : patch.layers) {
        if (info.type == type_) columns[grid_.unit_column(info.patch)].push_back(info);
      }
    }
    for (const auto& [column, layers] : columns) {
      std::fill(unit_.begin(), unit_.end(), bytes_ ? 0.0f : std::numeric_limits<float>::quiet_NaN());
      for (const LayerInfo& info : layers) paste(info);
      write_unit(column, row);
    }
  }

  void paste(const LayerInfo& info) {
    check_cancelled(run_);
    source_.load(info, layer_);
    const Layer* cells = &layer_;
    if (layer_.step() != grid_.step) {
      (layer_.step() < grid_.step ? split : merged) += 1;
      resample(layer_, source_.header().types[type_], grid_.step, fitted_);
      cells = &fitted_;
    }
    const std::int64_t side = cells->side(), unit = grid_.unit;
    const auto [left, top] = grid_.place_in_unit(info.patch);
    const std::size_t bands = static_cast<std::size_t>(painter_.bands());
    std::array<float, 16> out{};
    for (std::int64_t b = 0; b < side; ++b) {
      for (std::int64_t a = 0; a < side; ++a) {
        painter_.paint(*cells, static_cast<std::size_t>(b * side + a), std::span(out).first(bands));
        const auto at = static_cast<std::size_t>((top + side - 1 - b) * unit + left + a);
        for (std::size_t i = 0; i < bands; ++i)
          unit_[i * static_cast<std::size_t>(unit * unit) + at] = out[i];
      }
    }
    if (run_.progress) run_.progress(++done_, total_);
  }

  void write_unit(std::int64_t column, std::int64_t row) {
    const std::int64_t tiles = grid_.unit / grid_.tile;
    for (std::int64_t y = 0; y < tiles; ++y) {
      for (std::int64_t x = 0; x < tiles; ++x) {
        for (int band = 0; band < painter_.bands(); ++band) write_tile(band, column, row, x, y);
      }
    }
  }

  /// Tile (x, y) of a unit, unless it holds no data at all.
  void write_tile(int band, std::int64_t column, std::int64_t row, std::int64_t x, std::int64_t y) {
    const std::int64_t tiles = grid_.unit / grid_.tile, unit = grid_.unit, tile = grid_.tile;
    const auto plane = static_cast<std::int64_t>(band) * unit * unit;
    bool any = false;
    for (std::int64_t line = 0; line < tile; ++line) {
      const auto from = unit_.begin() + plane + (y * tile + line) * unit + x * tile;
      std::copy(from, from + tile, tile_.begin() + line * tile);
    }
    for (const float v : tile_) any = any || (bytes_ ? v != 0 : !std::isnan(v));
    if (!any) return;
    void* values = tile_.data();
    if (bytes_) {
      byte_tile_.assign(tile_.begin(), tile_.end());
      values = byte_tile_.data();
    }
    file_.write(band, column * tiles + x, row * tiles + y, values);
  }

  const PatchSource& source_;
  TypeId type_;
  const TileGrid& grid_;
  Painter& painter_;
  TiffFile& file_;
  bool bytes_;
  const RunOptions& run_;
  std::vector<float> unit_, tile_;
  std::vector<std::uint8_t> byte_tile_;
  Layer layer_, fitted_;
  std::uint64_t done_ = 0, total_ = 0;
};

/// The mass a class stood for when the map was read, if it still tells.
std::optional<double> class_mass_of(const MapHeader& header) {
  const auto it = header.metadata.find("geotiff.class_mass");
  return it == header.metadata.end() ? std::nullopt : parse_number(it->second);
}

std::map<PatchIndex, std::int64_t> stamps_of(const PatchSource& source, TypeId type, const RunOptions& run) {
  std::map<PatchIndex, std::int64_t> stamps;
  std::uint64_t left_out = 0;
  const auto cursor = source.patches();
  PatchInfo patch;
  while (cursor->next(patch)) {
    for (const LayerInfo& info : patch.layers) {
      if (info.type != type || info.stamp_ns == 0) continue;
      if (stamps.size() < kMostStamps) {
        stamps[info.patch] = info.stamp_ns;
      } else {
        ++left_out;
      }
    }
  }
  if (left_out > 0 && run.findings) {
    run.findings(
        {Finding::Kind::kLoss, "the stamps of " + std::to_string(left_out) + " patches are left out"});
  }
  return stamps;
}

TiffLayout layout_of(const TileGrid& grid, const MapTags& tags, const SettingsReader& settings) {
  TiffLayout layout;
  layout.width = grid.width;
  layout.height = grid.height;
  layout.tile = grid.tile;
  layout.bytes = tags.classes;
  const Box box = tags.frame.box_m(grid.range);
  layout.left_m = box.min.x_m;
  layout.top_m = box.max.y_m;
  layout.pixel_m = tags.frame.cell_m(tags.step);
  layout.bands = tags.type.channels;
  if (tags.classes) {
    layout.bands = {tags.type.name};
    layout.colours = class_colours(tags.type);
  }
  layout.items = to_items(tags);
  const auto compression = settings.choice("compression", kCompressions);
  if (compression == "deflate") layout.compression = TiffCompression::kDeflate;
  if (compression == "none") layout.compression = TiffCompression::kNone;
  const bool deflate = layout.compression == TiffCompression::kDeflate;
  layout.level = whole(settings, "level", 1, deflate ? 9 : 19).value_or(deflate ? 6 : 3);
  return layout;
}

void report(const TileWriter& tiles, const Painter& painter, int step, const Findings& findings) {
  const auto loss = [&](std::uint64_t count, const std::string& what) {
    if (count > 0 && findings) findings({Finding::Kind::kLoss, std::to_string(count) + what});
  };
  loss(tiles.split, " layers of coarser cells are split to step " + std::to_string(step));
  loss(tiles.merged, " layers of finer cells are merged to step " + std::to_string(step));
  loss(painter.graded, " cells keep only the class of the greatest BetP");
  loss(painter.without_number, " cells that are known to hold no number become cells without data");
}

/// A unit of tiles and patches is put together in memory, with GDAL's cache and its list of tiles beside it.
void check_memory(const PatchSource& source, const std::vector<TypeId>& chosen, const MapTags& tags,
                  const TileGrid& grid, std::uint64_t max_memory_bytes) {
  if (max_memory_bytes == 0) return;
  const std::uint64_t bands = tags.classes ? 1 : tags.type.channels.size();
  const auto unit = static_cast<std::uint64_t>(grid.unit), tile = static_cast<std::uint64_t>(grid.tile);
  const auto tiles = [&](std::int64_t pixels) {
    return (static_cast<std::uint64_t>(pixels) + tile - 1) / tile;
  };
  constexpr std::uint64_t kTileCopies = 4;  // as cut out, in the cache, predicted and compressed
  constexpr std::uint64_t kListBytes = 48;  // of a tile: place and size, as read and as written
  constexpr std::uint64_t kGdalBytes = std::uint64_t{4}
                                       << 20;  // what it sets up at its first file: some 3 MiB seen
  const std::uint64_t fixed = kGdalBytes + unit * unit * bands * sizeof(float) +
                              kTileCopies * tile * tile * sizeof(float) +
                              tiles(grid.width) * tiles(grid.height) * bands * kListBytes +
                              static_cast<std::uint64_t>(grid.width / grid.unit + 1) * sizeof(LayerInfo) * 2 +
                              reading_bytes(source, chosen, tags.step);
  // The cache takes a quarter of the budget.
  const std::uint64_t cache = CacheShare::of(max_memory_bytes);
  if (fixed + cache <= max_memory_bytes) return;
  check_budget(max_memory_bytes, std::min(fixed + fixed / 3, fixed + CacheShare::of(0)) + CacheShare::of(1),
               "a GeoTIFF is put together tiles and patches at a time", "set a smaller step");
}

bool wants_classes(const SettingsReader& settings) { return settings.choice("mode", kModes) == "classes"; }

}  // namespace

void check_raster_export(const SettingsReader& settings) {
  settings.choice("mode", kModes);
  whole(settings, "step", 0, kMaxStep);
  const auto compression = settings.choice("compression", kCompressions);
  const auto level = whole(settings, "level", 1, compression == "deflate" ? 9 : 19);
  if (level && compression == "none") settings.refuse("level", "does not apply without compression");
}

std::vector<std::string> raster_files(const WriteRequest& request, const SettingsReader& settings) {
  std::vector<std::string> files{request.path};
  if (wants_classes(settings)) files.push_back(legend_file_of(request.path));
  return files;
}

void check_side_file(const WriteRequest& request) {
  std::error_code ignored;
  const std::string side = legend_file_of(request.path);
  if (request.output.overwrite || !std::filesystem::exists(std::filesystem::symlink_status(side, ignored))) {
    return;
  }
  throw Error(ErrorCode::kOutput, "'" + side + "' already exists, and GDAL would read it with the new raster")
      .hint("pass --overwrite to replace it, or remove it")
      .at(side);
}

void export_raster(const PatchSource& source, const WriteRequest& request, const SettingsReader& settings) {
  check_raster_export(settings);
  check_side_file(request);
  const auto type = choose_layer(source, request.layer);
  if (!type) throw Error(ErrorCode::kIncompatible, "the map has no layers that a GeoTIFF could hold");
  const std::vector<TypeId> chosen{*type};
  MapTags tags;
  tags.classes = wants_classes(settings);
  tags.type = source.header().types[*type];
  if (tags.classes && !tags.type.is_evidence()) {
    throw Error(ErrorCode::kIncompatible, "layer '" + tags.type.name + "' holds values, not classes")
        .hint("choose another with --layer, or mode=masses, which writes values as they are");
  }
  tags.frame = source.header().frame;
  tags.step = whole(settings, "step", 0, kMaxStep).value_or(finest_step(source.summary(), chosen));
  tags.stamp_ns = source.header().stamp_ns;
  tags.stamps_ns = stamps_of(source, *type, request.run);
  if (tags.classes) tags.class_mass = class_mass_of(source.header());

  OutputFile tiff(request.path, request.output);
  std::optional<OutputFile> legend;
  if (tags.classes) legend.emplace(legend_file_of(request.path), request.output);
  const TileGrid grid = TileGrid::of(source, *type, tags.step, request.run);
  check_memory(source, chosen, tags, grid, request.run.max_memory_bytes);
  TiffFile file(request.path, layout_of(grid, tags, settings), tags.frame, request.run.findings,
                request.run.max_memory_bytes);
  Painter painter(tags.type, tags.classes, tags.class_mass);
  TileWriter tiles(source, *type, grid, painter, file, tags.classes, request.run);
  tiles.write_all();
  file.copy_to(tiff);
  if (legend) legend->write(legend_file(tags.type));
  report(tiles, painter, tags.step, request.run.findings);
  report_left_out(source, chosen, request.run.findings);
  tiff.flush();
  if (legend) {
    legend->flush();
    legend->commit();
  }
  tiff.commit();
  std::error_code ignored;
  if (!legend) std::filesystem::remove(legend_file_of(request.path), ignored);
}

}  // namespace apgm::converters

#include "converters/map_server/export.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "converters/common/choose.hpp"
#include "converters/common/file.hpp"
#include "converters/map_server/import.hpp"
#include "converters/map_server/picture_source.hpp"
#include "converters/map_server/png.hpp"

namespace apgm::converters {
namespace {

constexpr std::array<std::string_view, 2> kImages{"pgm", "png"};

/// Cells of the finest step, counted from the datum: [x0, x1) x [y0, y1).
struct CellBox {
  std::int64_t x0 = std::numeric_limits<std::int64_t>::max(), y0 = x0;
  std::int64_t x1 = std::numeric_limits<std::int64_t>::min(), y1 = x1;

  bool empty() const { return x1 <= x0; }
  void add(const CellBox& o) {
    x0 = std::min(x0, o.x0), y0 = std::min(y0, o.y0);
    x1 = std::max(x1, o.x1), y1 = std::max(y1, o.y1);
  }
  bool holds(const CellBox& o) const {
    return o.empty() || (x0 <= o.x0 && y0 <= o.y0 && o.x1 <= x1 && o.y1 <= y1);
  }
};

std::optional<double> stored_number(const MapHeader& header, const std::string& key) {
  const auto it = header.metadata.find("map_server." + key);
  return it == header.metadata.end() ? std::nullopt : parse_number(it->second);
}

/// The rule of the import, where the map still tells it, under the settings.
CellRule rule_of(const MapHeader& header, const SettingsReader& settings) {
  CellRule rule;
  const auto stored = header.metadata.find("map_server.mode");
  std::optional<MapMode> imported;
  if (stored != header.metadata.end()) imported = map_mode_from(stored->second);
  rule.mode = imported.value_or(MapMode::kTrinary);
  if (const auto mode = settings.choice("mode", kMapModes)) rule.mode = *map_mode_from(*mode);
  if (rule.mode == MapMode::kScale) {
    rule.occupied_thresh = 1;
    rule.free_thresh = 0;
  }
  if (imported == rule.mode) {
    rule.negate = stored_number(header, "negate").value_or(0) != 0;
    rule.occupied_thresh = stored_number(header, "occupied_thresh").value_or(rule.occupied_thresh);
    rule.free_thresh = stored_number(header, "free_thresh").value_or(rule.free_thresh);
  }
  rule.negate = settings.flag("negate").value_or(rule.negate);
  rule.occupied_thresh = settings.number("occupied_thresh", 0, 1).value_or(rule.occupied_thresh);
  rule.free_thresh = settings.number("free_thresh", 0, 1).value_or(rule.free_thresh);
  if (rule.free_thresh > rule.occupied_thresh) {
    settings.refuse(settings.has("free_thresh") ? "free_thresh" : "occupied_thresh",
                    "puts free_thresh above occupied_thresh");
  }
  return rule;
}

/// Takes beliefs to the values of a picture and counts those a reader will not get back.
class Valuer {
 public:
  Valuer(const MapHeader& header, const CellRule& rule) : rule_(rule) {
    occupied_ = {static_cast<float>(stored_number(header, "occupied_mass").value_or(kTrinaryMass)), 0};
    free_ = {0, static_cast<float>(stored_number(header, "free_mass").value_or(kTrinaryMass))};
  }

  GridValue operator()(Masses masses) {
    if (rule_.mode != MapMode::kTrinary) {
      const auto value = static_cast<GridValue>(std::rint(pignistic(masses) * 100));
      graded += masses != masses_from_probability(value / 100.0);
      return value;
    }
    if (masses == occupied_) return kOccupied;
    if (masses == free_) return kFree;
    ++graded;
    const double p = pignistic(masses);
    return p > rule_.occupied_thresh ? kOccupied : p < rule_.free_thresh ? kFree : kUnknown;
  }

  std::uint64_t graded = 0;

 private:
  CellRule rule_;
  Masses occupied_, free_;
};

/// Calls visit(CellBox, Masses) for each known cell of a type; the box counts cells of `step`.
template <class Visit>
void visit_cells(const PatchSource& source, TypeId type, int step, const std::optional<PatchRange>& range,
                 const RunOptions& run, Visit visit) {
  const auto cursor = source.patches(range);
  PatchInfo patch;
  Layer layer;
  while (cursor->next(patch)) {
    check_cancelled(run);
    for (const LayerInfo& info : patch.layers) {
      if (info.type != type) continue;
      source.load(info, layer);
      const std::int64_t size = std::int64_t{1} << (step - layer.step());
      const std::int64_t x = std::int64_t{patch.patch.x} << step, y = std::int64_t{patch.patch.y} << step;
      const auto occupied = layer.plane(0), free = layer.plane(1);
      for (std::int64_t b = 0, i = 0; b < layer.side(); ++b) {
        for (std::int64_t a = 0; a < layer.side(); ++a, ++i) {
          const Masses masses{occupied[static_cast<std::size_t>(i)], free[static_cast<std::size_t>(i)]};
          if (masses == Masses{}) continue;
          visit(CellBox{x + a * size, y + b * size, x + (a + 1) * size, y + (b + 1) * size}, masses);
        }
      }
    }
  }
}

/// The picture's size at the import, in cells of `step`, if the map is still on its grid and was not cut or
/// joined.
std::optional<CellBox> imported_extent(const MapHeader& header, int step) {
  const auto text = header.metadata.find("map_server.origin");
  const auto width = stored_number(header, "width"), height = stored_number(header, "height");
  const auto resolution = stored_number(header, "resolution");
  const bool changed =
      std::ranges::any_of(header.history, [](const auto& h) { return h.operation != "convert"; });
  if (text == header.metadata.end() || !width || !height || !resolution || changed) return {};
  const std::size_t comma = std::min(text->second.find(','), text->second.size());
  const auto x = parse_number(std::string_view(text->second).substr(0, comma));
  const auto y = comma < text->second.size() ? parse_number(std::string_view(text->second).substr(comma + 1))
                                             : std::nullopt;
  const auto sane = [](double size) { return size >= 1 && size <= 2147483647.0 && size == std::floor(size); };
  if (!x || !y || std::fabs(*x) > 1e9 || std::fabs(*y) > 1e9 || !sane(*width) || !sane(*height)) return {};
  const Frame& frame = header.frame;
  if (std::fabs(std::ldexp(*resolution, step) * 1e6 - static_cast<double>(frame.edge_um)) > 0.501) return {};
  const __int128 dx = static_cast<__int128>(to_micrometres(*x) - frame.datum_x_um) << step;
  const __int128 dy = static_cast<__int128>(to_micrometres(*y) - frame.datum_y_um) << step;
  if (dx % frame.edge_um != 0 || dy % frame.edge_um != 0) return {};
  const auto x0 = static_cast<std::int64_t>(dx / frame.edge_um),
             y0 = static_cast<std::int64_t>(dy / frame.edge_um);
  return CellBox{x0, y0, x0 + static_cast<std::int64_t>(*width), y0 + static_cast<std::int64_t>(*height)};
}

CellBox extent_of(const PatchSource& source, std::optional<TypeId> type, int step, const RunOptions& run) {
  CellBox known;
  if (type) visit_cells(source, *type, step, {}, run, [&](const CellBox& cell, Masses) { known.add(cell); });
  const auto imported = imported_extent(source.header(), step);
  if (imported && imported->holds(known)) return *imported;
  if (!known.empty()) return known;
  if (run.findings)
    run.findings({Finding::Kind::kWarning, "the map has no known cells: the picture is one pixel"});
  return {0, 0, 1, 1};
}

/// Rows of a picture, made from the top a row of patches at a time.
class BandPainter {
 public:
  /// @throws over_budget() if `run` does not allow a row of patches
  BandPainter(const PatchSource& source, std::optional<TypeId> type, int step, const CellBox& extent,
              Valuer& valuer, const RunOptions& run)
      : source_(source), type_(type), step_(step), extent_(extent), valuer_(valuer), run_(run) {
    check_pixels(width(), height());
    std::vector<TypeId> chosen;
    if (type) chosen.push_back(*type);
    const auto band = static_cast<std::uint64_t>(width() * std::min(height(), std::int64_t{1} << step));
    check_budget(run.max_memory_bytes, band + reading_bytes(source, chosen, step),
                 "a picture is painted a row of patches at a time", "crop the map, or resample it");
  }

  std::int64_t width() const { return extent_.x1 - extent_.x0; }
  std::int64_t height() const { return extent_.y1 - extent_.y0; }

  /// Row `y` from the top; rows are asked for in their order.
  std::span<const GridValue> row(std::int64_t y) {
    const std::int64_t cell = extent_.y1 - 1 - y;
    if (band_.empty() || cell < low_) paint(cell);
    return std::span(band_).subspan(static_cast<std::size_t>((high_ - 1 - cell) * width()),
                                    static_cast<std::size_t>(width()));
  }

 private:
  /// The patches that hold cells of row `cell`, as far as they lie in the picture.
  void paint(std::int64_t cell) {
    const std::int64_t patch = cell >> step_;
    low_ = std::max(extent_.y0, patch << step_);
    high_ = std::min(extent_.y1, (patch + 1) << step_);
    band_.assign(static_cast<std::size_t>((high_ - low_) * width()), kUnknown);
    if (!type_) return;
    // A picture may reach beyond all patches.
    const auto index = [&](std::int64_t c) {
      using Limits = std::numeric_limits<std::int32_t>;
      return static_cast<std::int32_t>(std::clamp<std::int64_t>(c >> step_, Limits::min(), Limits::max()));
    };
    const PatchRange range{{index(extent_.x0), index(cell)}, {index(extent_.x1 - 1), index(cell)}};
    visit_cells(source_, *type_, step_, range, run_, [&](const CellBox& at, Masses masses) {
      const GridValue value = valuer_(masses);
      for (std::int64_t y = at.y0; y < at.y1; ++y) {
        const auto row = band_.begin() + (high_ - 1 - y) * width() - extent_.x0;
        std::fill(row + at.x0, row + at.x1, value);
      }
    });
  }

  const PatchSource& source_;
  std::optional<TypeId> type_;
  int step_;
  CellBox extent_;
  Valuer& valuer_;
  const RunOptions& run_;
  std::int64_t low_ = 0, high_ = 0;  // rows of cells in the band
  std::vector<GridValue> band_;      // the top row first
};

void write_pgm(OutputFile& file, BandPainter& painter, const GreyTable& greys) {
  file.write("P5\n" + std::to_string(painter.width()) + " " + std::to_string(painter.height()) + "\n255\n");
  std::vector<std::byte> row(static_cast<std::size_t>(painter.width()));
  for (std::int64_t y = 0; y < painter.height(); ++y) {
    std::ranges::transform(painter.row(y), row.begin(), [&](GridValue v) { return std::byte{greys.of(v)}; });
    file.write(row);
  }
}

void write_raster_png(OutputFile& file, BandPainter& painter, const GreyTable& greys, bool alpha) {
  write_png(file, painter.width(), painter.height(), alpha, [&](std::int64_t y, std::span<std::uint8_t> row) {
    std::size_t i = 0;
    for (const GridValue value : painter.row(y)) {
      row[i++] = greys.of(value);
      if (alpha) row[i++] = value == kUnknown ? 0 : 255;
    }
  });
}

void report(const Valuer& valuer, const CellRule& rule, const Findings& findings) {
  if (valuer.graded == 0 || !findings) return;
  findings({Finding::Kind::kLoss, std::to_string(valuer.graded) +
                                      (rule.mode == MapMode::kTrinary
                                           ? " cells keep only whether they are occupied, free or unknown"
                                           : " cells keep BetP(O) in percent only")});
}

MapYaml yaml_of(const Frame& frame, int step, const CellBox& extent, const CellRule& rule) {
  const double scale = 1e6 * (1 << step);
  const auto metres = [&](std::int64_t datum_um, std::int64_t cell) {
    return static_cast<double>((static_cast<__int128>(datum_um) << step) +
                               static_cast<__int128>(cell) * frame.edge_um) /
           scale;
  };
  MapYaml map;
  map.resolution_m = static_cast<double>(frame.edge_um) / scale;
  map.x_m = metres(frame.datum_x_um, extent.x0);
  map.y_m = metres(frame.datum_y_um, extent.y0);
  map.rule = rule;
  return map;
}

/// What is written, as far as the map's header and the settings tell.
struct Plan {
  CellRule rule;
  bool png = false;
  std::filesystem::path picture;
};

Plan plan_of(const MapHeader& header, const std::string& path, const SettingsReader& settings) {
  const std::string extension = extension_of(path);
  if (extension != ".yaml" && extension != ".yml") {
    throw Error(ErrorCode::kInvalidArgument, "'" + path + "' does not end in .yaml or .yml")
        .hint("a map is FILE.yaml with FILE.pgm or FILE.png beside it");
  }
  Plan plan;
  plan.rule = rule_of(header, settings);
  const bool alpha = plan.rule.mode == MapMode::kScale;
  const std::string image = settings.choice("image", kImages).value_or(alpha ? "png" : "pgm");
  if (alpha && image == "pgm")
    settings.refuse("image", "cannot hold unknown cells in mode scale, which PNG can");
  plan.png = image == "png";
  plan.picture = std::filesystem::path(path).replace_extension(image);
  return plan;
}

}  // namespace

void check_picture(const std::string& yaml, const std::string& picture, const OutputOptions& output) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  if (!fs::exists(fs::symlink_status(picture, ignored))) return;
  Error error(ErrorCode::kOutput, "picture '" + picture + "' already exists");
  error.at(picture);
  if (!output.overwrite) throw error.hint("pass --overwrite to replace a map with its picture");
  const auto own = picture_of(yaml);
  if (own && (fs::path(*own).lexically_normal() == fs::path(picture).lexically_normal() ||
              fs::equivalent(*own, picture, ignored)))
    return;
  throw Error(ErrorCode::kOutput,
              "picture '" + picture + "' already exists, and is not that of '" + yaml + "'")
      .hint("choose another name, or remove the picture")
      .at(picture);
}

void check_export_settings(const SettingsReader& settings) {
  const auto mode = settings.choice("mode", kMapModes), image = settings.choice("image", kImages);
  settings.flag("negate");
  const auto occupied = settings.number("occupied_thresh", 0, 1), free = settings.number("free_thresh", 0, 1);
  if (occupied && free && *free > *occupied) settings.refuse("free_thresh", "lies above occupied_thresh");
  if (mode == "scale" && image == "pgm")
    settings.refuse("image", "cannot hold unknown cells in mode scale, which PNG can");
}

std::vector<std::string> exported_files(const MapHeader& header, const WriteRequest& request,
                                        const SettingsReader& settings) {
  return {request.path, plan_of(header, request.path, settings).picture.string()};
}

void export_map(const PatchSource& source, const WriteRequest& request, const SettingsReader& settings) {
  const Plan plan = plan_of(source.header(), request.path, settings);
  const CellRule& rule = plan.rule;
  const GreyTable greys = grey_table(rule);
  const auto type = choose_occupancy(source, request.layer);
  const std::vector<TypeId> chosen = type ? std::vector<TypeId>{*type} : std::vector<TypeId>{};
  const int step = finest_step(source.summary(), chosen);
  check_picture(request.path, plan.picture.string(), request.output);
  OutputFile picture(plan.picture.string(), request.output);
  OutputFile yaml(request.path, request.output);

  const CellBox extent = extent_of(source, type, step, request.run);
  Valuer valuer(source.header(), rule);
  BandPainter painter(source, type, step, extent, valuer, request.run);
  if (plan.png) {
    write_raster_png(picture, painter, greys, rule.mode == MapMode::kScale);
  } else {
    write_pgm(picture, painter, greys);
  }
  MapYaml map = yaml_of(source.header().frame, step, extent, rule);
  map.image = plan.picture.filename().string();
  yaml.write(to_text(map));
  report(valuer, rule, request.run.findings);
  report_left_out(source, chosen, request.run.findings);
  picture.flush();
  yaml.flush();
  // The YAML last: a map that can be found is whole.
  picture.commit();
  yaml.commit();
}

}  // namespace apgm::converters

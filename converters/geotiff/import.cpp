#include "converters/geotiff/import.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "converters/common/file.hpp"
#include "converters/geotiff/raster_source.hpp"
#include "converters/geotiff/tags.hpp"

namespace apgm::converters {
namespace {

constexpr std::array<std::string_view, 4> kKinds{"masses", "classes", "probability", "value"};
constexpr std::array<std::string_view, 2> kInvalid{"error", "unknown"};
constexpr std::array<std::string_view, 11> kPolicies{"exclusive", "conditional", "min",      "product",
                                                     "median",    "dempster",    "evidence", "mean",
                                                     "sum",       "minimum",     "maximum"};

void tell(const Findings& findings, Finding::Kind kind, std::string text) {
  if (findings) findings({kind, std::move(text)});
}

/// One reading: what the raster says of itself, under the settings.
class Import {
 public:
  Import(const ReadRequest& request, const SettingsReader& settings)
      : request_(request),
        settings_(settings),
        raster_(std::make_shared<Raster>(request.path, request.max_memory_bytes)),
        tags_(naming(request.path, [&] { return from_items(raster_->tags()); })) {}

  std::unique_ptr<PatchSource> open(const Converter& converter) {
    RasterPlan plan;
    plan.raster = raster_;
    plan.rule = rule();
    plan.keep_invalid_out = settings_.choice("invalid", kInvalid) == "unknown";
    const std::optional<std::int32_t> epsg = checked_epsg();
    const ForeignGrid grid = grid_of_raster();
    const bool own = own_grid(grid, plan.fit);
    if (!own) plan.fit = fitted(grid, epsg, converter);
    if (own && epsg) plan.fit.native.epsg = epsg;
    plan.header.metadata["geotiff.as"] = kind();
    if (class_mass_) plan.header.metadata["geotiff.class_mass"] = format_number(*class_mass_);
    if (tags_ && own) {
      plan.header.stamp_ns = tags_->stamp_ns;
      plan.stamps_ns = tags_->stamps_ns;
    }
    const GridFit fit = plan.fit;
    auto native = naming(request_.path, [&] { return std::make_unique<RasterSource>(std::move(plan)); });
    report(native->tally());
    return place(std::move(native), grid, fit, request_.findings);
  }

 private:
  std::string kind() const {
    if (const auto asked = settings_.choice("as", kKinds)) return *asked;
    if (tags_) return tags_->classes ? "classes" : tags_->type.is_evidence() ? "masses" : "value";
    if (settings_.has("legend") || !band_of_classes().categories.empty()) return "classes";
    throw Error(ErrorCode::kUnsupported, "'" + request_.path + "' does not say what its values mean")
        .hint("pass --set as=masses, as=classes (with legend=FILE), as=probability or as=value")
        .at(request_.path);
  }

  bool asked_otherwise() const {
    return settings_.has("as") || settings_.has("layer") || settings_.has("channels") ||
           settings_.has("band") || settings_.has("legend");
  }

  int band() const {
    const auto given = settings_.number("band", 1, 1024);
    const auto count = static_cast<double>(raster_->bands().size());
    if (given && *given > count) {
      settings_.refuse("band", "does not exist: the raster has " + format_number(count));
    }
    return static_cast<int>(given.value_or(1)) - 1;
  }
  const RasterBand& band_of_classes() const { return raster_->bands()[static_cast<std::size_t>(band())]; }

  /// The bands that are read as channels.
  std::vector<int> channel_bands() const {
    if (settings_.has("band")) return {band()};
    std::vector<int> bands;
    for (std::size_t i = 0; i < raster_->bands().size(); ++i) bands.push_back(static_cast<int>(i));
    if (bands.size() > 16) {
      throw Error(ErrorCode::kUnsupported, "'" + request_.path + "' has " + std::to_string(bands.size()) +
                                               " bands, a layer has at most 16 channels")
          .hint("--set band=N reads one of them, gdal_translate -b picks some")
          .at(request_.path);
    }
    return bands;
  }

  std::string layer_name(const char* usual) const { return settings_.text("layer").value_or(usual); }

  Policy policy(Policy usual) const {
    const auto name = settings_.choice("policy", kPolicies);
    return name ? *policy_from(*name) : usual;
  }

  /// Names of channels: as asked for, as the bands are called, or by number.
  std::vector<std::string> channel_names(const std::vector<int>& bands, const char* prefix) const {
    std::vector<std::string> names;
    if (const auto list = settings_.text("channels")) {
      std::size_t from = 0;
      while (from <= list->size()) {
        const std::size_t comma = std::min(list->find(',', from), list->size());
        names.push_back(list->substr(from, comma - from));
        from = comma + 1;
      }
      if (names.size() != bands.size()) {
        settings_.refuse("channels", "does not name " + std::to_string(bands.size()) + " bands");
      }
      return names;
    }
    for (const int b : bands) {
      const std::string& said = raster_->bands()[static_cast<std::size_t>(b)].description;
      names.push_back(usable(said) ? said : prefix == nullptr ? "" : prefix + std::to_string(b + 1));
    }
    return names;
  }

  static bool usable(const std::string& name) {
    try {
      LayerType::real("x", {name}).check();
      return true;
    } catch (const Error&) {
      return false;
    }
  }

  /// A type made of the settings: what does not fit is the caller's.
  static LayerType checked(LayerType type) {
    type.check();
    return type;
  }

  std::unique_ptr<PixelRule> rule() {
    const std::string as = kind();
    if (tags_ && !asked_otherwise()) return tagged_rule();
    if (as == "masses") return foreign_masses();
    if (as == "classes") return foreign_classes();
    if (as == "probability") {
      return probability_rule(
          checked(LayerType::occupancy(layer_name("occupancy"), policy(Policy::kConditional))), band());
    }
    const auto bands = channel_bands();
    return value_rule(
        checked(LayerType::real(layer_name("value"), channel_names(bands, "band_"), policy(Policy::kMean))),
        bands);
  }

  std::unique_ptr<PixelRule> tagged_rule() {
    LayerType type = tags_->type;
    type.policy = policy(type.policy);
    type.check();
    const auto bands = channel_bands();
    const std::size_t wanted = tags_->classes ? 1 : type.channels.size();
    if (bands.size() != wanted) {
      throw Error(ErrorCode::kDamaged, "'" + request_.path + "' has " + std::to_string(bands.size()) +
                                           " bands, its metadata tells of " + std::to_string(wanted))
          .hint("say what the bands are: --set as=masses, classes, probability or value")
          .at(request_.path);
    }
    if (!type.is_evidence()) return value_rule(std::move(type), bands);
    if (!tags_->classes) return mass_rule(std::move(type), bands);
    Legend legend;
    for (std::size_t k = 0; k < type.hypotheses.size(); ++k) {
      legend.codes[static_cast<std::int64_t>(k) + 1] = static_cast<int>(k);
    }
    legend.codes[0] = Legend::kUnknown;
    legend.classes = type.hypotheses;
    return classes(std::move(type), std::move(legend));
  }

  std::unique_ptr<PixelRule> foreign_masses() const {
    const auto bands = channel_bands();
    auto names = channel_names(bands, nullptr);
    const bool named = std::ranges::none_of(names, [](const auto& n) { return n.empty(); });
    if (!named && bands.size() == 2) names = {"O", "F"};
    if (!named && bands.size() != 2) {
      throw Error(ErrorCode::kUnsupported, "'" + request_.path + "' does not name the hypotheses of its " +
                                               std::to_string(bands.size()) + " bands")
          .hint("pass --set channels=A,B,...; the last may be Omega")
          .at(request_.path);
    }
    LayerType type;
    type.channels = names;
    type.hypotheses = names;
    if (names.back() == "Omega") type.hypotheses.pop_back();
    const bool occupancy = type.is_occupancy();
    type.name = layer_name(occupancy ? "occupancy" : "semantic");
    type.policy = policy(occupancy             ? Policy::kConditional
                         : type.stores_omega() ? Policy::kEvidence
                                               : Policy::kMean);
    return mass_rule(checked(std::move(type)), bands);
  }

  std::unique_ptr<PixelRule> foreign_classes() {
    const RasterBand& band = band_of_classes();
    if (!band.integer) {
      throw Error(ErrorCode::kUnsupported, "the band of '" + request_.path + "' holds no whole numbers")
          .hint("class codes are integers; as=probability and as=value read real ones")
          .at(request_.path);
    }
    Legend legend;
    if (const auto path = settings_.text("legend")) {
      legend = read_legend(*path);
    } else if (!band.categories.empty()) {
      auto names = band.categories;
      if (band.no_data && std::fabs(*band.no_data) < 0x1p53) {
        names.erase(static_cast<std::int64_t>(*band.no_data));
      }
      legend = naming(request_.path, [&] { return legend_from(names, request_.findings); });
    } else {
      throw Error(ErrorCode::kUnsupported, "'" + request_.path + "' does not name its classes")
          .hint("pass --set legend=FILE, a .csv of 'code,name' or a .yaml of 'code: name'")
          .at(request_.path);
    }
    LayerType type =
        checked(LayerType::semantic(layer_name("semantic"), legend.classes, policy(Policy::kMean)));
    return classes(std::move(type), std::move(legend));
  }

  std::unique_ptr<PixelRule> classes(LayerType type, Legend legend) {
    const std::optional<double> stored = tags_ ? tags_->class_mass : std::nullopt;
    class_mass_ = settings_.number("class_mass", 1e-6, 1).value_or(stored.value_or(kClassMass));
    std::optional<int> other;
    if (const auto name = settings_.text("unknown_class"); name && *name != "error") {
      const auto it = std::ranges::find(legend.classes, *name);
      if (*name != "Omega" && it == legend.classes.end()) {
        settings_.refuse("unknown_class", "is neither error, Omega, nor a class of the legend");
      }
      other = *name == "Omega" ? Legend::kUnknown : static_cast<int>(it - legend.classes.begin());
    }
    return class_rule(std::move(type), band(), std::move(legend), static_cast<float>(*class_mass_), other);
  }

  /// The EPSG code of the map. @throws Error{kUnsupported} if the raster's coordinates cannot be a map's
  std::optional<std::int32_t> checked_epsg() const {
    const RasterCrs& crs = raster_->crs();
    const auto refuse = [&](const std::string& what, const char* hint) {
      throw Error(ErrorCode::kUnsupported, "'" + request_.path + "' " + what).hint(hint).at(request_.path);
    };
    Frame given;
    read_names(settings_, given);
    if (crs.kind == RasterCrs::Kind::kNone && !given.epsg && settings_.flag("allow_no_crs") != true) {
      refuse("has no coordinate reference system",
             "--set epsg=CODE says which it is, --set allow_no_crs=1 that it is metres of no known one");
    }
    if (crs.kind == RasterCrs::Kind::kNotMetres) {
      refuse("lies in '" + crs.name + "', which is not in metres",
             "gdalwarp -t_srs EPSG:CODE brings it to a projected one, as UTM");
    }
    if (given.epsg) {
      if (crs.epsg && *crs.epsg != *given.epsg) {
        tell(request_.findings, Finding::Kind::kWarning,
             "epsg=" + std::to_string(*given.epsg) +
                 " replaces the raster's EPSG:" + std::to_string(*crs.epsg));
      }
      return given.epsg;
    }
    if (!crs.epsg && !crs.local && crs.kind == RasterCrs::Kind::kMetres && !tags_) {
      tell(request_.findings, Finding::Kind::kLoss,
           "the raster's CRS '" + crs.name + "' has no EPSG code: the map's is unknown");
    }
    return crs.epsg;
  }

  /// Square cells of the raster. @throws Error{kUnsupported} if they are not and cell_m does not say so
  ForeignGrid grid_of_raster() const {
    const double dx = raster_->pixel_x_m(), dy = raster_->pixel_y_m();
    const auto asked = settings_.number("cell_m", 1e-6, 1e6);
    const double width = static_cast<double>(raster_->width()),
                 height = static_cast<double>(raster_->height());
    // A difference that moves no pixel by a thousandth of one is one of printed digits.
    const double drift = std::fabs(dx - dy) * std::max(width, height);
    if (!asked && drift <= 1e-3 * dx) return {dx, raster_->corner_m(), 0};
    if (!asked) {
      throw Error(ErrorCode::kUnsupported, "the pixels of '" + request_.path + "' are not square: " +
                                               format_number(dx) + " x " + format_number(dy) + " m")
          .hint("gdalwarp -tr makes square ones; --set cell_m=M takes them as squares, which moves them")
          .at(request_.path);
    }
    // Moved as little as can be: the middle stays where it is.
    const Point corner{raster_->corner_m().x_m + (dx - *asked) * width / 2,
                       raster_->corner_m().y_m + (dy - *asked) * height / 2};
    const double moved = std::max(std::fabs(dx - *asked) * width, std::fabs(dy - *asked) * height) / 2;
    if (moved > 0) {
      tell(request_.findings, Finding::Kind::kLoss,
           "pixels of " + format_number(dx) + " x " + format_number(dy) + " m are taken as squares of " +
               format_number(*asked) + " m: they move by up to " +
               format_number(std::ceil(moved * 1000) / 1000) + " m");
    }
    return {*asked, corner, 0};
  }

  /// The grid of the map the raster was written from, if its coordinates still lie on it.
  bool own_grid(const ForeignGrid& grid, GridFit& fit) const {
    if (!tags_ || settings_.has("edge_m") || settings_.has("datum") || settings_.has("cell_m")) return false;
    const Frame& frame = tags_->frame;
    const double cell = frame.cell_m(tags_->step);
    const double x = (grid.origin_m.x_m - frame.datum_m().x_m) / cell;
    const double y = (grid.origin_m.y_m - frame.datum_m().y_m) / cell;
    const double pixels = static_cast<double>(std::max(raster_->width(), raster_->height()));
    constexpr double kOnGrid = 1e-3;  // cells
    const bool on_grid = std::fabs(grid.cell_m - cell) * pixels <= kOnGrid * cell &&
                         std::fabs(x - std::nearbyint(x)) <= kOnGrid &&
                         std::fabs(y - std::nearbyint(y)) <= kOnGrid && std::fabs(x) < 0x1p52 &&
                         std::fabs(y) < 0x1p52;
    if (!on_grid) {
      tell(request_.findings, Finding::Kind::kNote,
           "the raster no longer lies on the grid of the map it was written from: its patches are new");
      return false;
    }
    fit.native = frame;
    read_names(settings_, fit.native);
    fit.step = tags_->step;
    // Cell (0, 0) of the raster is that many cells from the datum.
    fit.offset_x = static_cast<std::int64_t>(std::nearbyint(x));
    fit.offset_y = static_cast<std::int64_t>(std::nearbyint(y));
    return true;
  }

  /// Patches for any other raster: of cells larger than 1 m 128 a side, or as many as 10 km allow.
  GridFit fitted(const ForeignGrid& grid, std::optional<std::int32_t> epsg,
                 const Converter& converter) const {
    Settings given = request_.settings;
    if (!given.contains("edge_m") && grid.cell_m > 1) {
      constexpr double kLargestEdge_m = 10'000;
      int step = 7;
      while (step > 0 && std::ldexp(grid.cell_m, step) > kLargestEdge_m) --step;
      given["edge_m"] = format_number(std::ldexp(grid.cell_m, step));
    }
    if (epsg) given["epsg"] = std::to_string(*epsg);
    if (tags_ && !given.contains("frame_id")) given["frame_id"] = tags_->frame.frame_id;
    const SettingsReader settings(converter, given, Use::kReading);
    return naming(request_.path, [&] { return fit_grid(grid, settings, request_.findings); });
  }

  void report(const RasterTally& tally) const {
    const auto loss = [&](std::uint64_t count, const char* what) {
      if (count > 0) tell(request_.findings, Finding::Kind::kLoss, std::to_string(count) + what);
    };
    loss(tally.invalid, " cells with invalid values become cells without data");
    loss(tally.even, " cells of probability 0.5 become cells without data");
    loss(tally.rounded, " cells hold values that are rounded to float32");
    std::size_t told = 0;
    for (const auto& [code, count] : tally.unnamed) {
      if (++told > 8) {
        loss(tally.unnamed.size() - 8, " more codes are not in the legend");
        break;
      }
      loss(count, (" pixels of code " + std::to_string(code) + ", which the legend does not name, become " +
                   settings_.text("unknown_class").value_or(""))
                      .c_str());
    }
  }

  const ReadRequest& request_;
  const SettingsReader& settings_;
  std::shared_ptr<const Raster> raster_;
  std::optional<MapTags> tags_;
  std::optional<double> class_mass_;
};

}  // namespace

void check_raster_import(const SettingsReader& settings) {
  settings.choice("as", kKinds);
  settings.choice("invalid", kInvalid);
  settings.choice("policy", kPolicies);
  settings.flag("allow_no_crs");
  settings.number("class_mass", 1e-6, 1);
  settings.number("cell_m", 1e-6, 1e6);
  const auto band = settings.number("band", 1, 1024);
  if (band && *band != std::floor(*band)) settings.refuse("band", "is not a whole number");
  if (const auto name = settings.text("layer")) {
    try {
      LayerType::real(*name, {"x"}).check();
    } catch (const Error& error) {
      settings.refuse("layer", "is not usable: " + error.hint());
    }
  }
  fit_grid({1.0, {}, 0}, settings, {});
}

std::unique_ptr<PatchSource> import_raster(const ReadRequest& request, const Converter& converter) {
  const SettingsReader settings(converter, request.settings, Use::kReading);
  check_raster_import(settings);
  return Import(request, settings).open(converter);
}

}  // namespace apgm::converters

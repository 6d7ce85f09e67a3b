#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>

#include "apgm/format/reader.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/ops/crop.hpp"
#include "tools/common/app.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/geojson.hpp"
#include "tools/common/options.hpp"
#include "tools/common/report.hpp"

namespace apgm::tools {
namespace {

constexpr const char* kRegionGroup = "Region (several: what they share)";

class CropTool final : public Tool {
 public:
  ToolInfo info() const override {
    return {.verb = "crop",
            .summary = "cut a region out of a map",
            .usage = "[OPTIONS] INPUT -o OUTPUT",
            .details = {"Keeps what lies in the region; patches wholly inside are copied as they are stored. "
                        "A region that meets no patch gives a valid map without patches.",
                        "Boxes are half-open, in metres of the map's CRS. So are the coordinates of a "
                        "GeoJSON file: they are not taken as degrees."},
            .examples = {{"apgm-crop --bbox -10,0,90,60 site.apgm -o gate.apgm", "the cells that meet a box"},
                         {"apgm-crop --polygon yard.geojson --snap patch site.apgm -o yard.apgm",
                          "the patches that meet an area"},
                         {"apgm-crop --salvage damaged.apgm -o rest.apgm",
                          "all layers that are whole; lists the others and ends with exit code 3"}},
            .exit_codes = {{kExitLoss, "written, but damaged layers were left out (--salvage)"},
                           {kExitOutput, "the output exists, is not permitted, or the disk is full"},
                           {kExitLimit, "a limit of the format or the budget is met"},
                           {kExitIncompatible, "--like names a map of another frame"}}};
  }

  void add_options(CLI::App& app) override {
    add_text(app, kRegionGroup, "--bbox", box_, "XMIN,YMIN,XMAX,YMAX", "a box");
    add_text(app, kRegionGroup, "--polygon", polygon_, "FILE.geojson",
             "an area: Polygon, MultiPolygon, Feature or FeatureCollection; even-odd over all rings; '-' is "
             "standard input");
    add_text(app, kRegionGroup, "--like", like_, "FILE", "the patches another map of the same frame has");
    add_text(app, kRegionGroup, "--snap", snap_, "cell|patch",
             "keep the cells (default) or the whole patches that meet the region");
    add_switch(app, "Filter", "--salvage", options_.salvage,
               "leave out layers that are damaged, instead of failing");
    filter_.add(app, false);
    output_.add(app);
    writing_.add(app);
    heavy_.add(app);
  }

  void check(Session& session, const std::vector<std::string>& inputs) override {
    input_ = one_input(inputs);
    filter_.check();
    if (box_) region_.box = parse_box("--bbox", *box_);
    if (snap_ && parse_choice("--snap", *snap_, {"cell", "patch"}) == "patch") options_.snap = Snap::kPatch;
    if (!box_ && !polygon_ && !like_ && !filter_.any() && !options_.salvage) {
      throw usage_error("there is nothing to crop by",
                        "pass --bbox, --polygon, --like, --layer or --salvage");
    }
    writing_.check();
    heavy_.check();
    std::vector<std::string> read{input_};
    if (polygon_) read.push_back(*polygon_);
    if (like_) read.push_back(*like_);
    if (std::count(read.begin(), read.end(), "-") > 1) {
      throw usage_error("standard input '-' is named twice");
    }
    output_.check(session, read);
    warn_of_extension(session, output_.path, ".apgm");
  }

  void run(Session& session) override {
    options_.layers = filter_.layers;
    if (polygon_) region_.polygon = read_geojson(*polygon_);
    const Reader source(input_);
    step_opened(session, input_, source);
    warn_of_delta(session, input_, source.header());
    std::optional<Reader> like;
    if (like_) {
      region_.like = &like.emplace(*like_);
      check_like(source, *like);
    }
    MapHeader header = crop_header(source, region_, options_);
    writing_.apply(header, {});
    session.result()["input"] = {{"path", input_}, {"content_id", source.content_id()}};
    if (output_.dry_run) return report_dry_run(session, output_);
    session.check_cancelled();
    Writer writer(output_.path, header, writing_.options(output_));
    const CropReport report =
        crop(source, region_, options_, writer, session.run_options(heavy_, "cropping"));
    session.check_cancelled();
    writer.finish();
    session.result()["layers_stored"] = report.layers_stored;
    session.result()["damaged_layers"] = report.salvaged;
    session.step(fmt::format("{} of {} layers copied as stored", report.layers_stored, report.layers));
    report_written(session, output_, writer.report());
  }

 private:
  void check_like(const Reader& source, const Reader& like) const {
    const Frame &a = source.header().frame, &b = like.header().frame;
    if (a == b) return;
    const auto epsg = [](const Frame& f) {
      return f.epsg ? std::to_string(*f.epsg) : std::string("unknown");
    };
    const auto datum = [](const Frame& f) {
      return number_text(f.datum_m().x_m) + "," + number_text(f.datum_m().y_m);
    };
    std::vector<std::string> faults;
    if (a.frame_id != b.frame_id) {
      faults.push_back(fmt::format("frames differ ('{}' and '{}')", a.frame_id, b.frame_id));
    }
    if (a.epsg != b.epsg) faults.push_back(fmt::format("EPSG codes differ ({} and {})", epsg(a), epsg(b)));
    if (a.edge_um != b.edge_um) {
      faults.push_back(fmt::format("patch edges differ ({} m and {} m)", number_text(a.edge_m()),
                                   number_text(b.edge_m())));
    }
    if (a.datum_x_um != b.datum_x_um || a.datum_y_um != b.datum_y_um) {
      faults.push_back(fmt::format("datums differ ({} m and {} m)", datum(a), datum(b)));
    }
    Error error(ErrorCode::kIncompatible,
                fmt::format("cannot crop '{}' like '{}': {}", input_, *like_, join(faults)));
    error.hint("both need the same datum, patch edge, EPSG code and frame id").at(*like_);
    throw error;
  }

  std::string input_;
  std::optional<std::string> box_, polygon_, like_, snap_;
  CropRegion region_;
  CropOptions options_;
  Filter filter_;
  OutputChoice output_;
  MapWriting writing_;
  HeavyOptions heavy_;
};

}  // namespace
}  // namespace apgm::tools

int main(int argc, char** argv) {
  apgm::tools::CropTool tool;
  return apgm::tools::run_tool(tool, argc, argv);
}

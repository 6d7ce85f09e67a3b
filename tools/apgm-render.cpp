#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "apgm/core/budget.hpp"
#include "apgm/format/output_file.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/ops/render.hpp"
#include "tools/common/app.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/options.hpp"
#include "tools/common/picture.hpp"
#include "tools/common/report.hpp"
#include "tools/common/suggest.hpp"

namespace apgm::tools {
namespace {

constexpr int kLeastGridPx = 16;      // patches below this are drawn without squares
constexpr int kForcedGridPx = 4;      // with --grid
constexpr std::uint64_t kCopies = 4;  // of a picture that are held on its way to PNG, at most

std::vector<std::string> colormap_names() {
  std::vector<std::string> names;
  for (const auto map :
       {Colormap::kBelief, Colormap::kEvidence, Colormap::kGrey, Colormap::kCategories, Colormap::kRamp}) {
    names.emplace_back(to_string(map));
  }
  return names;
}

std::string base_name(const std::string& path) {
  if (path == "-") return "standard input";
  return path.substr(path.rfind('/') + 1);
}

class RenderTool final : public Tool {
 public:
  ToolInfo info() const override {
    return {"render",
            "draw a map as a PNG picture",
            "[OPTIONS] INPUT -o OUT.png",
            {"The picture shows one layer from above, north up, with a legend, a scale bar and the "
             "coordinates of its "
             "corners. Where pixels are coarser than cells, cells are merged as the layer's own policy asks, "
             "so that "
             "no obstacle vanishes."},
            {{"apgm-render site.apgm -o site.png", "the whole map, at most 2048 pixels a side"},
             {"apgm-render site.apgm -o gate.png --bbox 10,-5,35,20 --scale 0.05", "a part, enlarged"},
             {"apgm-render site.apgm -o raw.png --colormap grey --no-legend", "the pixels alone"}},
            {{kExitOutput, "the output exists, is not permitted, or the disk is full"},
             {kExitLimit, "the picture would be too large"}}};
  }

  void add_options(CLI::App& app) override {
    output_.add(app);
    add_list(app, "Picture", "--layer", layers_, "NAME",
             "the layer to draw (default: the first occupancy layer, else the first)");
    add_text(app, "Picture", "--channel", channel_, "NAME",
             "of a layer of numbers, the channel to draw (default: the first)");
    add_text(app, "Picture", "--bbox", box_text_, "XMIN,YMIN,XMAX,YMAX",
             "draw this area, in metres of the map's CRS (default: all patches)");
    add_text(app, "Picture", "--scale", scale_text_, "M_PER_PX",
             "size of a pixel in metres; taken down to the next that fits the cells");
    add_text(app, "Picture", "--colormap", colormap_text_, "NAME",
             "belief, evidence, grey (occupancy); categories (hypotheses); ramp (numbers)");
    CLI::Option* grid = add_switch(app, "Picture", "--grid", grid_, "draw patches from 4 pixels on");
    add_switch(app, "Picture", "--no-grid", no_grid_,
               "draw no patches (default: drawn if at least 16 pixels wide)")
        ->excludes(grid);
    add_switch(app, "Picture", "--no-legend", bare_, "the pixels of the map and nothing else");
    heavy_.add(app);
  }

  void check(Session& session, const std::vector<std::string>& inputs) override {
    input_ = one_input(inputs);
    if (layers_.size() > 1) {
      throw usage_error("--layer is given twice", "a picture shows one layer: make one picture each");
    }
    if (box_text_) options_.area = parse_box("--bbox", *box_text_);
    if (scale_text_) options_.pixel_m = parse_positive("--scale", *scale_text_);
    if (colormap_text_) {
      options_.colormap = *colormap_from(parse_choice("--colormap", *colormap_text_, colormap_names()));
    }
    options_.min_patch_px = grid_ ? kForcedGridPx : kLeastGridPx;
    heavy_.check();
    output_.check(session, inputs);
    warn_of_extension(session, output_.path, ".png");
  }

  void run(Session& session) override {
    const Reader source(input_);
    step_opened(session, input_, source);
    choose_layer(session, source);
    RunOptions run = session.run_options(heavy_, "drawing");
    if (run.max_memory_bytes > 0) {
      run.max_memory_bytes = std::max<std::uint64_t>(1, run.max_memory_bytes / kCopies);
    }
    // A map without types is empty: there is nothing to ask of it.
    Rendering rendering = source.header().types.empty() ? Rendering{} : draw(source, run);
    if (no_grid_) rendering.patch_px = 0;
    if (rendering.layers == 0) {
      session.note(fmt::format("'{}' holds no data {}: the picture shows none", input_,
                               options_.area ? "in the box" : "to draw"));
    } else if (options_.pixel_m && rendering.pixel_m < *options_.pixel_m * (1 - 1e-6)) {
      session.note(fmt::format("pixels are {} m wide, the next size below {} m that fits the cells",
                               number_text(rendering.pixel_m), number_text(*options_.pixel_m)));
    }
    const bool bare = bare_ && !rendering.raster.empty();
    const Raster picture = bare ? rendering.raster : compose(rendering, text(source, rendering));
    session.check_cancelled();
    if (!output_.dry_run) write(session, picture);
    report(session, source, rendering, picture);
  }

 private:
  /// The library's budget is a part of --max-memory.
  Rendering draw(const Reader& source, const RunOptions& run) const {
    try {
      return render(source, options_, run);
    } catch (const Error& error) {
      const auto hint = budget_hint(error);
      if (!hint) throw;
      const std::uint64_t least = kCopies * hint->least_mebibytes;
      throw over_budget(
          fmt::format("a picture is drawn in memory: that takes {} MiB, more than is allowed", least),
          least << 20, "choose a larger --scale or a smaller --bbox");
    }
  }

  void choose_layer(Session& session, const Reader& source) {
    const TypeTable& types = source.header().types;
    if (!layers_.empty()) {
      const auto found = types.find(layers_.front());
      if (!found) refuse_layer(types);
      options_.type = *found;
    } else {
      options_.type = default_layer(source);
      tell_choice(session, source);
    }
    if (types.empty()) return;
    if (channel_) choose_channel(types[options_.type]);
  }

  [[noreturn]] void refuse_layer(const TypeTable& types) const {
    std::vector<std::string> names;
    for (const LayerType& type : types) names.push_back(type.name);
    throw usage_error(fmt::format("'{}' has no layer '{}'", input_, layers_.front()),
                      names.empty() ? "it has no layers"
                                    : did_you_mean(layers_.front(), names, "its layers: " + join(names)));
  }

  // The first that holds something to show, occupancy before others.
  static TypeId default_layer(const Reader& source) {
    const TypeTable& types = source.header().types;
    const Summary summary = source.summary();
    const auto rank = [&](TypeId id) {
      const bool filled = id < summary.types.size() && summary.types[id].layers > 0;
      return (filled ? 2 : 0) + (types[id].is_occupancy() ? 1 : 0);
    };
    TypeId best = 0;
    for (std::size_t id = 1; id < types.size(); ++id) {
      if (rank(static_cast<TypeId>(id)) > rank(best)) best = static_cast<TypeId>(id);
    }
    return best;
  }

  /// Slices of one height each look alike: which of them is drawn must be said.
  void tell_choice(Session& session, const Reader& source) const {
    const TypeTable& types = source.header().types;
    if (types.empty() || !types[options_.type].is_occupancy()) return;
    const Summary summary = source.summary();
    std::uint64_t others = 0;
    for (std::size_t id = 0; id < types.size(); ++id) {
      const bool other = id != options_.type && types[static_cast<TypeId>(id)].is_occupancy();
      if (other && summary.types[id].layers > 0) ++others;
    }
    if (others == 0) return;
    session.note(fmt::format("layer '{}' is drawn; the map has {}, drawn with --layer",
                             types[options_.type].name,
                             plural(others, "other occupancy layer", "other occupancy layers")));
  }

  void choose_channel(const LayerType& type) {
    if (type.is_evidence()) {
      throw usage_error(fmt::format("--channel does not apply to layer '{}'", type.name),
                        "all its masses are drawn in one picture");
    }
    const auto it = std::find(type.channels.begin(), type.channels.end(), *channel_);
    if (it == type.channels.end()) {
      throw usage_error(fmt::format("layer '{}' has no channel '{}'", type.name, *channel_),
                        "its channels: " + join(type.channels));
    }
    options_.channel = static_cast<int>(it - type.channels.begin());
  }

  PictureText text(const Reader& source, const Rendering& rendering) const {
    const MapHeader& header = source.header();
    PictureText out;
    out.title = base_name(input_);
    if (!header.types.empty()) {
      const LayerType& type = header.types[options_.type];
      out.facts.push_back("layer " + type.name);
      if (!type.is_evidence()) {
        out.facts.push_back("channel " + type.channels[static_cast<std::size_t>(options_.channel)]);
      }
    }
    if (!rendering.raster.empty()) {
      out.facts.push_back(fmt::format("{:.6g} m/px", rendering.pixel_m));
      out.facts.push_back(fmt::format("{} x {} px", rendering.raster.width, rendering.raster.height));
    }
    if (rendering.patch_px > 0 && rendering.layers > 0) {
      out.facts.push_back(fmt::format("patches of {:.6g} m", header.frame.edge_m()));
    }
    out.facts.push_back("frame " + header.frame.frame_id);
    if (header.frame.epsg) out.facts.push_back(fmt::format("EPSG:{}", *header.frame.epsg));
    out.up = header.frame.epsg ? "N" : "y";
    return out;
  }

  void write(Session& session, const Raster& picture) const {
    OutputFile file(output_.path, output_.options());
    write_png(picture, file);
    session.check_cancelled();
    file.commit();
    session.done(fmt::format("wrote '{}': {} x {} pixels, {}", output_.path, picture.width, picture.height,
                             size_text(file.size())));
  }

  void report(Session& session, const Reader& source, const Rendering& rendering,
              const Raster& picture) const {
    const TypeTable& types = source.header().types;
    session.result() = {
        {"output", output_.path},
        {"dry_run", output_.dry_run},
        {"layer", types.empty() ? Json() : Json(types[options_.type].name)},
        {"layers_drawn", rendering.layers},
        {"area_m", rendering.raster.empty() ? Json() : box_json(rendering.area)},
        {"pixel_m", rendering.raster.empty() ? Json() : Json(rendering.pixel_m)},
        {"map_px", {rendering.raster.width, rendering.raster.height}},
        {"picture_px", {picture.width, picture.height}},
    };
  }

  OutputChoice output_;
  HeavyOptions heavy_;
  RenderOptions options_;
  std::vector<std::string> layers_;
  std::optional<std::string> channel_, box_text_, scale_text_, colormap_text_;
  bool grid_ = false, no_grid_ = false, bare_ = false;
  std::string input_;
};

}  // namespace
}  // namespace apgm::tools

int main(int argc, char** argv) {
  apgm::tools::RenderTool tool;
  return apgm::tools::run_tool(tool, argc, argv);
}

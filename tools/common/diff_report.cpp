#include "tools/common/diff_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "tools/common/options.hpp"

namespace apgm::tools {
namespace {

struct Kind {
  const char* key;
  const char* words;
  CellTally TypeDiff::*tally;
};

/// The kinds of change a type of cells can have.
std::vector<Kind> kinds_of(const LayerType& type) {
  std::vector<Kind> kinds{{"learned", "learned (unknown -> known)", &TypeDiff::learned},
                          {"forgotten", "forgotten (known -> unknown)", &TypeDiff::forgotten}};
  if (type.is_occupancy()) {
    kinds.push_back({"free_to_occupied", "free -> occupied", &TypeDiff::free_to_occupied});
    kinds.push_back({"occupied_to_free", "occupied -> free", &TypeDiff::occupied_to_free});
  } else if (type.is_evidence()) {
    kinds.push_back({"class_changed", "class changed", &TypeDiff::class_changed});
  }
  kinds.push_back({"adjusted", "adjusted", &TypeDiff::adjusted});
  return kinds;
}

Json spread_json(const Spread& spread) { return {{"mean", spread.mean}, {"max", spread.max}}; }
Json tally_json(const CellTally& tally) { return {{"cells", tally.cells}, {"area_m2", tally.area_m2}}; }

void add_cells(const TypeDiff& diff, Json& layer) {
  layer["compared"] = tally_json(diff.compared);
  layer["changed"] = tally_json(diff.changed);
  for (const Kind& kind : kinds_of(diff.type)) layer[kind.key] = tally_json(diff.*kind.tally);
  if (diff.type.is_evidence()) {
    layer["betp_delta"] = spread_json(diff.betp_delta);
    layer["mass_delta_max"] = diff.max_mass_delta;
    layer["kl_divergence_nat"] = diff.kl_divergence;
    layer["jousselme"] = spread_json(diff.jousselme);
    layer["conflict"] = spread_json(diff.conflict);
    return;
  }
  layer["channels"] = Json::array();
  for (std::size_t c = 0; c < diff.channels.size(); ++c) {
    Json channel = {{"name", diff.type.channels[c]},
                    {"cells", diff.channels[c].cells},
                    {"delta", spread_json(diff.channels[c].delta)}};
    layer["channels"].push_back(std::move(channel));
  }
}

Json layer_json(const TypeDiff& diff, DiffLevel level) {
  Json layer = {{"name", diff.type.name},
                {"layers_added", diff.layers_added},
                {"layers_removed", diff.layers_removed},
                {"layers_changed", diff.layers_changed},
                {"layers_equal", diff.layers_equal},
                {"layers_of_two_steps", diff.layers_of_two_steps},
                {"layers_of_two_stamps", diff.layers_of_two_stamps}};
  if (level != DiffLevel::kBytes) add_cells(diff, layer);
  return layer;
}

std::string line(const std::string& name, const std::string& text) {
  return fmt::format("  {:<32}{}\n", name, text);
}

std::string counts(std::uint64_t added, std::uint64_t removed, std::uint64_t changed, std::uint64_t equal) {
  return fmt::format("{} added, {} removed, {} changed, {} equal", count_text(added), count_text(removed),
                     count_text(changed), count_text(equal));
}

std::string tally_text(const CellTally& tally) {
  return fmt::format("{}, {:.6g} m2", plural(tally.cells, "cell", "cells"), tally.area_m2);
}

std::string spread_text(const Spread& spread) {
  return fmt::format("mean {:.4g}, max {:.4g}", spread.mean, spread.max);
}

std::string cells_text(const TypeDiff& diff) {
  std::string text = line("compared", tally_text(diff.compared));
  text += line("changed", tally_text(diff.changed));
  for (const Kind& kind : kinds_of(diff.type)) {
    if ((diff.*kind.tally).cells > 0)
      text += line(std::string("  ") + kind.words, tally_text(diff.*kind.tally));
  }
  if (diff.type.is_evidence()) {
    text += line("|delta BetP|", spread_text(diff.betp_delta));
    text += line("|delta m|", fmt::format("max {:.4g}", diff.max_mass_delta));
    text += line("KL divergence of BetP", fmt::format("{:.6g} nat", diff.kl_divergence));
    text += line("Jousselme distance", spread_text(diff.jousselme));
    text += line("conflict K", spread_text(diff.conflict));
  }
  for (std::size_t c = 0; c < diff.channels.size(); ++c) {
    text += line("|delta " + diff.type.channels[c] + "|", spread_text(diff.channels[c].delta));
  }
  return text;
}

std::string layer_text(const TypeDiff& diff, DiffLevel level) {
  std::string text = fmt::format("\nlayer '{}'\n", diff.type.name);
  text +=
      line("layers", counts(diff.layers_added, diff.layers_removed, diff.layers_changed, diff.layers_equal));
  if (diff.layers_of_two_steps > 0) {
    text += line("layers of two steps", count_text(diff.layers_of_two_steps) +
                                            (level == DiffLevel::kBytes ? "" : ", compared at the coarser"));
  }
  if (diff.layers_of_two_stamps > 0)
    text += line("layers of two stamps", count_text(diff.layers_of_two_stamps));
  // Without layers that differ there is nothing to tell of cells.
  if (level != DiffLevel::kBytes && diff.compared.cells > 0) text += cells_text(diff);
  return text;
}

std::string regions_text(const DiffReport& report, std::size_t top) {
  if (top == 0 || report.regions.empty()) return {};
  TextTable table({">", ">changed", "--bbox"});
  const std::size_t shown = std::min(top, report.regions.size());
  for (std::size_t i = 0; i < shown; ++i) {
    const Box& box = report.regions[i].box;
    table.add({std::to_string(i + 1), fmt::format("{:.6g} m2", report.regions[i].area_m2),
               fmt::format("{},{},{},{}", number_text(box.min.x_m), number_text(box.min.y_m),
                           number_text(box.max.x_m), number_text(box.max.y_m))});
  }
  return fmt::format("\n{} of {}, most area first\n", shown,
                     plural(report.regions.size(), "region that changed", "regions that changed")) +
         table.text();
}

}  // namespace

std::string to_string(DiffLevel level) {
  return level == DiffLevel::kBytes ? "bytes" : level == DiffLevel::kCells ? "cells" : "belief";
}

Json diff_json(const DiffReport& report, DiffLevel level, std::size_t top) {
  Json layers = Json::array();
  for (const TypeDiff& diff : report.types) layers.push_back(layer_json(diff, level));
  Json out = {{"equal", !report.different},
              {"patches",
               {{"added", report.patches_added},
                {"removed", report.patches_removed},
                {"changed", report.patches_changed},
                {"equal", report.patches_equal}}},
              {"layers", std::move(layers)},
              {"header_differences", report.header_differences}};
  if (top == 0) return out;
  out["regions_found"] = report.regions.size();
  out["regions"] = Json::array();
  for (std::size_t i = 0; i < std::min(top, report.regions.size()); ++i) {
    out["regions"].push_back(
        {{"bbox_m", box_json(report.regions[i].box)}, {"changed_area_m2", report.regions[i].area_m2}});
  }
  return out;
}

std::string diff_text(const DiffReport& report, DiffLevel level, std::size_t top) {
  std::string text = line("patches", counts(report.patches_added, report.patches_removed,
                                            report.patches_changed, report.patches_equal));
  for (const TypeDiff& diff : report.types) text += layer_text(diff, level);
  text += regions_text(report, top);
  if (!report.header_differences.empty()) {
    text += "\nheaders differ in " + join(report.header_differences) + "\n";
  }
  return text;
}

}  // namespace apgm::tools

#include "tools/common/blame_report.hpp"

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <deque>

#include "apgm/format/content_id.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/ops/blame.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/grid.hpp"
#include "tools/common/options.hpp"
#include "tools/common/report.hpp"

namespace apgm::tools {
namespace {

Json cells_json(const std::vector<KnownCell>& cells, const Frame& frame) {
  Json list = Json::array();
  for (const KnownCell& cell : cells) {
    Json values = Json::object();
    for (std::size_t c = 0; c < cell.values.size(); ++c) values[cell.type.channels[c]] = cell.values[c];
    list.push_back({{"layer", cell.type.name},
                    {"values", values},
                    {"step", cell.step},
                    {"cell_m", frame.cell_m(cell.step)},
                    {"stamp_ns", cell.stamp_ns != 0 ? Json(cell.stamp_ns) : Json()}});
  }
  return list;
}

/// "occupancy: O 0.7, F 0.1 (cells of 0.2 m)", a line each.
std::string cells_text(const std::vector<KnownCell>& cells, const Frame& frame, const std::string& indent) {
  std::string text;
  for (const KnownCell& cell : cells) {
    std::vector<std::string> values;
    for (std::size_t c = 0; c < cell.values.size(); ++c) {
      values.push_back(fmt::format("{} {:.6g}", cell.type.channels[c], cell.values[c]));
    }
    text += fmt::format("{}{}: {} (cells of {} m)\n", indent, cell.type.name, join(values),
                        number_text(frame.cell_m(cell.step)));
  }
  return text;
}

const char* verdict(const Ancestor& ancestor) {
  if (ancestor.input) return ancestor.cells.empty() ? "does not know the point" : "observed the point";
  if (is_content_id(ancestor.id)) return "no file of it is given";
  return ancestor.id == "unknown" ? "has no content id" : "is no apgm map";
}

std::string ancestors_text(const Blame& found, const std::vector<BlameInput>& candidates) {
  if (found.ancestors.empty()) return "its history names no input\n";
  std::string text = "made of\n";
  for (const Ancestor& ancestor : found.ancestors) {
    const std::string indent(2 * static_cast<std::size_t>(ancestor.depth), ' ');
    const BlameInput* input = ancestor.input ? &candidates[*ancestor.input] : nullptr;
    text +=
        fmt::format("{}{}{} ({}) {}\n", indent, ancestor.id, input != nullptr ? " '" + input->name + "'" : "",
                    ancestor.step->operation, verdict(ancestor));
    if (input != nullptr) text += cells_text(ancestor.cells, input->source->header().frame, indent + "  ");
  }
  return text;
}

}  // namespace

void BlameQuestion::add(CLI::App& app) {
  add_text(app, "Blame", "--blame", text_, "X,Y",
           "say instead which of the INPUTs after the first, a merged map, observed a point in metres");
}

void BlameQuestion::check(const std::vector<std::string>& inputs) {
  if (!text_) return;
  check_inputs(inputs);
  if (inputs.size() < 2) {
    throw usage_error("--blame takes a merged map and the inputs to choose from: one map is given",
                      "apgm-diff --blame X,Y MERGED INPUT...");
  }
  point_ = parse_point("--blame", *text_, kMaxCoordinate_m);
}

bool BlameQuestion::answer(Session& session, const std::vector<std::string>& inputs) const {
  const Reader map(inputs[0]);
  step_opened(session, inputs[0], map);
  std::deque<Reader> readers;
  std::vector<BlameInput> candidates;
  for (std::size_t i = 1; i < inputs.size(); ++i) {
    step_opened(session, inputs[i], readers.emplace_back(inputs[i]));
    candidates.push_back({&readers.back(), inputs[i]});
    session.check_cancelled();
  }
  const Blame found = blame(map, point_, candidates);
  bool named = false;
  Json ancestors = Json::array();
  for (const Ancestor& ancestor : found.ancestors) {
    const BlameInput* input = ancestor.input ? &candidates[*ancestor.input] : nullptr;
    named |= !ancestor.cells.empty();
    ancestors.push_back(
        {{"content_id", ancestor.id},
         {"operation", ancestor.step->operation},
         {"depth", ancestor.depth},
         {"path", input != nullptr ? Json(input->name) : Json()},
         {"cells", cells_json(ancestor.cells, (input != nullptr ? *input->source : map).header().frame)}});
  }
  const Json cells = cells_json(found.cells, map.header().frame);
  session.print(fmt::format("({}, {}) m in '{}'{}\n", number_text(point_.x_m), number_text(point_.y_m),
                            inputs[0], cells.empty() ? " is unknown" : ""));
  session.print(cells_text(found.cells, map.header().frame, "  ") + ancestors_text(found, candidates));
  for (const std::size_t i : found.strangers) {
    session.warning(fmt::format("'{}' is not in the history of '{}'", candidates[i].name, inputs[0]));
  }
  session.result()["blame"] = {
      {"point_m", {point_.x_m, point_.y_m}}, {"path", inputs[0]}, {"cells", cells}, {"inputs", ancestors}};
  return named;
}

}  // namespace apgm::tools

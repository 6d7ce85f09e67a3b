#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <CLI/App.hpp>
#include <algorithm>

#include "apgm/format/reader.hpp"
#include "apgm/ops/statistics.hpp"
#include "tools/common/app.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/options.hpp"
#include "tools/common/report.hpp"
#include "tools/common/sketch.hpp"
#include "tools/common/source_view.hpp"

namespace apgm::tools {
namespace {

constexpr double kMetresPerMicrometre = 1e-6;
/// Of a step of the history, in the text for people.
constexpr std::size_t kMaxInputsShown = 16;

Json layer_json(const LayerType& type, const Summary::OfType& totals) {
  Json steps = Json::object();
  std::uint64_t cells = 0;
  for (std::size_t step = 0; step < totals.layers_at.size(); ++step) {
    if (totals.layers_at[step] == 0) continue;
    steps[std::to_string(step)] = totals.layers_at[step];
    cells += totals.layers_at[step] << (2 * step);
  }
  Json layer = {{"name", type.name},
                {"hypotheses", type.hypotheses},
                {"channels", type.channels},
                {"policy", to_string(type.policy)},
                {"patches", totals.layers},
                {"cells", cells},
                {"steps", steps},
                {"stored_bytes", totals.stored_bytes},
                {"raw_bytes", totals.raw_bytes}};
  if (type.slab) {
    layer["slab_m"] = {static_cast<double>(type.slab->z_min_um) * kMetresPerMicrometre,
                       static_cast<double>(type.slab->z_max_um) * kMetresPerMicrometre};
  }
  return layer;
}

Json history_json(const MapHeader& header) {
  Json steps = Json::array();
  for (const Provenance& step : header.history) {
    Json parameters = Json::parse(step.parameters, nullptr, false);
    if (parameters.is_discarded()) parameters = step.parameters;
    steps.push_back({{"operation", step.operation}, {"inputs", step.inputs}, {"parameters", parameters}});
  }
  return steps;
}

/// What the file is beside its map.
Json file_json(Session& session, const Reader& reader) {
  const FileInfo& file = reader.file();
  Json json = {{"bytes", file.file_bytes},
               {"format_version", fmt::format("{}.{}", file.version_major, file.version_minor)},
               {"archive", file.archive},
               {"commit", file.commits},
               {"commits", 1},
               {"message", ""},
               {"uncommitted_bytes", file.uncommitted_bytes}};
  if (!file.archive) return json;
  try {
    const std::vector<CommitInfo> commits = reader.commits();
    json["commits"] = commits.size();
    json["message"] = commits.back().message;
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kUnreadable) throw;
    session.warning(fmt::format("the commits of '{}' cannot be told: {}", reader.path(), error.message()));
    json["commits"] = json["message"] = nullptr;
  }
  return json;
}

Json document(Session& session, const Reader& reader, const PatchSource& view) {
  const MapHeader& header = view.header();
  const Frame& frame = header.frame;
  const Summary summary = view.summary();
  Json layers = Json::array();
  for (TypeId id = 0; id < header.types.size(); ++id) {
    layers.push_back(layer_json(header.types[id], summary.types[id]));
  }
  const Point datum = frame.datum_m();
  return {{"map",
           {{"edge_m", frame.edge_m()},
            {"datum_m", {datum.x_m, datum.y_m}},
            {"epsg", frame.epsg ? Json(*frame.epsg) : Json()},
            {"frame_id", frame.frame_id},
            {"patches", summary.patches},
            {"bbox_m", summary.range.empty() ? Json() : box_json(frame.box_m(summary.range))},
            {"content_id", reader.content_id()},
            {"metadata", header.metadata},
            {"stamp_ns", header.stamp_ns != 0 ? Json(header.stamp_ns) : Json()}}},
          {"layers", layers},
          {"file", file_json(session, reader)}};
}

void add_cell_counts(Json& document, const std::vector<CellStatistics>& counts) {
  for (std::size_t i = 0; i < counts.size(); ++i) {
    Json& layer = document["layers"][i];
    layer["known_cells"] = counts[i].known_cells;
    layer["occupied_cells"] = counts[i].occupied_cells;
    layer["free_cells"] = counts[i].free_cells;
    layer["max_mass_sum"] = counts[i].max_mass_sum;
  }
}

/// What a person reads of a long text; --json and --get give it whole.
std::string shortened(const std::string& text) {
  constexpr std::size_t kMaxShown = 200;
  if (text.size() <= kMaxShown) return text;
  std::size_t end = kMaxShown;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;  // a whole character
  return text.substr(0, end) + fmt::format("... ({})", plural(text.size(), "byte", "bytes"));
}

std::string numbers_text(const Json& list) {
  std::vector<std::string> words;
  for (const Json& n : list) words.push_back(to_line(n));
  return join(words);
}

/// "3 commits (last: 7, second drive)"
std::string commits_text(const Json& file) {
  if (!file["archive"].get<bool>()) return "1 commit";
  const std::string last = to_line(file["commit"]);
  if (file["commits"].is_null()) return "last commit " + last;
  const std::string message = shortened(first_line(file["message"]));
  return fmt::format("{} (last: {}{})", plural(file["commits"], "commit", "commits"), last,
                     message.empty() ? "" : ", " + message);
}

std::string map_text(const std::string& path, const Json& document) {
  const Json& map = document["map"];
  const Json& file = document["file"];
  const auto line = [](const char* name, const std::string& text) {
    return fmt::format("  {:<10}{}\n", name, text);
  };
  const auto patches = map["patches"].get<std::uint64_t>();
  std::string text = path + "\n";
  text += line("file", fmt::format("{}, format {}, {}", size_text(file["bytes"]),
                                   file["format_version"].get<std::string>(), commits_text(file)));
  text += line("frame", fmt::format("'{}', EPSG {}, datum ({}) m", map["frame_id"].get<std::string>(),
                                    map["epsg"].is_null() ? "unknown" : to_line(map["epsg"]),
                                    numbers_text(map["datum_m"])));
  text += line("patches", fmt::format("{} of {} m x {} m", count_text(patches), to_line(map["edge_m"]),
                                      to_line(map["edge_m"])));
  if (!map["bbox_m"].is_null()) text += line("box", fmt::format("{} m", numbers_text(map["bbox_m"])));
  text += line("content", map["content_id"].get<std::string>());
  for (const auto& [key, value] : map["metadata"].items()) {
    text += line("metadata", key + " = " + shortened(value.get<std::string>()));
  }
  if (patches == 0) text += "  the map holds no patches\n";
  return text;
}

std::string layers_text(const Json& layers, bool extended) {
  if (layers.empty()) return {};
  std::vector<std::string> headings{"layer",  "channels", "policy",  ">patches",
                                    ">cells", "steps",    ">stored", ">raw"};
  if (extended) {
    for (const char* name : {">known", ">occupied", ">free", ">max mass"}) headings.emplace_back(name);
  }
  TextTable table(headings);
  for (const Json& layer : layers) {
    std::vector<std::string> steps;
    for (const auto& [step, patches] : layer["steps"].items()) {
      steps.push_back(fmt::format("{}: {}", step, count_text(patches)));
    }
    std::string name = layer["name"];
    if (layer.contains("slab_m")) name += " [" + numbers_text(layer["slab_m"]) + ") m";
    std::vector<std::string> row{name,
                                 join(layer["channels"].get<std::vector<std::string>>(), " "),
                                 layer["policy"],
                                 count_text(layer["patches"]),
                                 count_text(layer["cells"]),
                                 join(steps),
                                 size_text(layer["stored_bytes"]),
                                 size_text(layer["raw_bytes"])};
    if (extended) {
      for (const char* key : {"known_cells", "occupied_cells", "free_cells"}) {
        row.push_back(count_text(layer[key]));
      }
      row.push_back(to_line(layer["max_mass_sum"]));
    }
    table.add(row);
  }
  return "\n" + table.text();
}

/// "rule dempster, regrid false"
std::string parameters_line(const Json& parameters) {
  if (!parameters.is_object()) return to_line(parameters);
  std::vector<std::string> words;
  for (const auto& [key, value] : parameters.items()) {
    words.push_back(key + " " + (value.is_string() ? value.get<std::string>() : to_line(value)));
  }
  return join(words);
}

std::string history_text(const Json& history) {
  if (history.empty()) return "\nhistory: none is stored\n";
  std::string text = "\nhistory, oldest first\n";
  int number = 0;
  for (const Json& step : history) {
    const auto inputs = step["inputs"].get<std::vector<std::string>>();
    text += fmt::format("  {}. {}{}\n", ++number, step["operation"].get<std::string>(),
                        inputs.size() == 1 ? " of " + inputs[0] : "");
    const std::string parameters = parameters_line(step["parameters"]);
    if (!parameters.empty()) text += "       " + shortened(parameters) + "\n";
    if (inputs.size() == 1) continue;
    for (std::size_t i = 0; i < std::min(inputs.size(), kMaxInputsShown); ++i) {
      text += fmt::format("       {} {}\n", i == 0 ? "of" : "  ", inputs[i]);
    }
    if (inputs.size() > kMaxInputsShown) {
      text += fmt::format("          and {}\n",
                          plural(inputs.size() - kMaxInputsShown, "more input", "more inputs"));
    }
  }
  return text;
}

std::string sketch_text(const PatchSource& source) {
  struct winsize size {};
  const bool known = ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 8;
  std::string text;
  for (const std::string& line : sketch(source, std::min(known ? size.ws_col - 4u : 60u, 72u), 16)) {
    text += "  " + line + "\n";
  }
  return text.empty() ? "" : "\n" + text;
}

class InfoTool final : public Tool {
 public:
  ToolInfo info() const override {
    return {
        .verb = "info",
        .summary = "say what an .apgm map holds",
        .usage = "[OPTIONS] INPUT",
        .details =
            {"Reads the head, the tail and where asked for the index of the file, never its cells "
             "unless --extended is given. '-' reads standard input. Of an archive it is the last commit; "
             "'apgm-archive log' lists them all."},
        .examples = {{"apgm-info site.apgm", "a summary for people, with a sketch of the map on a terminal"},
                     {"apgm-info --get map.patches site.apgm", "one value, for scripts"},
                     {"apgm-info --json --extended site.apgm",
                      "everything, with counts of known, occupied and free cells"}},
        .exit_codes = {{kExitLimit, "--max-memory is too small"}}};
  }

  void add_options(CLI::App& app) override {
    add_switch(app, "What to print", "--extended", extended_,
               "read all cells: known, occupied (BetP(O) > 0.5) and free cells, greatest mass sum");
    add_switch(app, "What to print", "--history", history_, "print how the map was made");
    add_text(app, "What to print", "--get", get_, "PATH",
             "print one value of the JSON document: map.patches, layers.occupancy.cells");
    filter_.add(app);
    heavy_.add(app);
  }

  void check(Session&, const std::vector<std::string>& inputs) override {
    input_ = one_input(inputs);
    filter_.check();
    heavy_.check();
  }

  void run(Session& session) override {
    const Reader reader(input_);
    step_opened(session, input_, reader);
    const SourceView view(reader, filter_.layers, filter_.box);
    const PatchSource& source = filter_.any() ? static_cast<const PatchSource&>(view) : reader;
    Json document = tools::document(session, reader, source);
    if (extended_) add_cell_counts(document, statistics(source, session.run_options(heavy_, "counting")));
    if (history_) document["history"] = history_json(source.header());
    if (get_) return print_value(session, document);
    session.print(map_text(input_, document) + layers_text(document["layers"], extended_));
    if (history_) session.print(history_text(document["history"]));
    if (!session.json && !session.quiet && ::isatty(STDOUT_FILENO) == 1) session.print(sketch_text(source));
    session.result() = std::move(document);
  }

 private:
  void print_value(Session& session, const Json& document) const {
    std::string keys;
    const Json* value = find_path(document, *get_, keys);
    if (value == nullptr) {
      throw usage_error(fmt::format("--get: there is no '{}'", *get_),
                        keys + (extended_ ? "" : "; counts of cells need --extended"));
    }
    session.print((value->is_string() ? value->get<std::string>() : to_line(*value)) + "\n");
    session.result() = {{"path", *get_}, {"value", *value}};
  }

  std::string input_;
  bool extended_ = false;
  bool history_ = false;
  std::optional<std::string> get_;
  Filter filter_;
  HeavyOptions heavy_;
};

}  // namespace
}  // namespace apgm::tools

int main(int argc, char** argv) {
  apgm::tools::InfoTool tool;
  return apgm::tools::run_tool(tool, argc, argv);
}

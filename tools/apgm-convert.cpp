#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <set>

#include "apgm/format/output_file.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"
#include "converters/common/converter.hpp"
#include "tools/common/app.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/options.hpp"
#include "tools/common/report.hpp"
#include "tools/common/source_view.hpp"
#include "tools/common/suggest.hpp"

namespace apgm::tools {
namespace {

using converters::Converter;
using converters::Settings;
using converters::SettingSpec;

constexpr const char* kApgm = "apgm";
constexpr const char* kConversionGroup = "Conversion";

std::vector<std::string> format_names(bool reading) {
  std::vector<std::string> names{kApgm};
  for (const Converter* c : converters::all()) {
    if (reading ? c->can_read() : c->can_write()) names.emplace_back(c->name());
  }
  return names;
}

/// The converter of a name, nullptr for .apgm itself.
const Converter* format_named(const std::string& option, const std::string& name, bool reading) {
  const std::string known = parse_choice(option, name, format_names(reading));
  return known == kApgm ? nullptr : converters::find(known);
}

bool has_suffix(const std::string& path, std::string_view suffix) { return path.ends_with(suffix); }

/// @return nullptr for .apgm. @throws Error{kInvalidArgument} if the extension says nothing
const Converter* format_of_output(const std::string& path) {
  if (path == "-" || has_suffix(path, ".apgm")) return nullptr;
  if (const Converter* converter = converters::for_extension(path)) return converter;
  throw usage_error(fmt::format("the extension of '{}' names no format", path),
                    "pass --to with one of: " + join(format_names(false)));
}

constexpr std::size_t kHeadBytes = 4096;

/// First bytes of standard input, which is left as it was; empty where that cannot be done.
std::string head_of_standard_input() {
  std::string head(kHeadBytes, '\0');
  const off_t at = ::lseek(STDIN_FILENO, 0, SEEK_CUR);
  ssize_t got = at < 0 ? -1 : ::pread(STDIN_FILENO, head.data(), head.size(), at);
  int copy[2] = {-1, -1};
  if (at < 0 && ::pipe(copy) == 0) {
    got = ::tee(STDIN_FILENO, copy[1], head.size(), 0);
    if (got > 0) got = ::read(copy[0], head.data(), static_cast<std::size_t>(got));
    ::close(copy[0]);
    ::close(copy[1]);
  }
  head.resize(static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
  return head;
}

/// First bytes of an input. @throws Error{kUnreadable}
std::string head_of(const std::string& path) {
  if (path == "-") return head_of_standard_input();
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), std::fclose);
  std::string head(kHeadBytes, '\0');
  const std::size_t got = file == nullptr ? 0 : std::fread(head.data(), 1, head.size(), file.get());
  if (file == nullptr || std::ferror(file.get()) != 0) {
    const int error = errno;
    throw Error(ErrorCode::kUnreadable, fmt::format("cannot open '{}': {}", path, std::strerror(error)))
        .hint(error == ENOENT ? "check the name and the directory" : "")
        .at(path);
  }
  head.resize(got);
  return head;
}

bool is_text(const std::string& head) {
  return !head.empty() && std::none_of(head.begin(), head.end(), [](unsigned char c) {
    return (c < 0x20 && c != '\n' && c != '\r' && c != '\t') || c == 0x7f;
  });
}

/// Text that is called YAML gets a message about its YAML.
const Converter* yaml_by_name(const std::string& path, const std::string& head) {
  const Converter* converter = converters::find("map_server");
  return converter != nullptr && converters::for_extension(path) == converter && is_text(head) ? converter
                                                                                               : nullptr;
}

[[noreturn]] void fail_unknown(const std::string& path, const std::string& head) {
  const bool png = head.starts_with("\x89PNG"), pgm = head.starts_with("P2") || head.starts_with("P5");
  std::string hint = "apgm-convert reads: " + join(format_names(true));
  if (png || pgm) hint += "; a picture is read by the YAML of its map";
  Error error(ErrorCode::kForeign, fmt::format("'{}' is of no format apgm-convert reads{}", path,
                                               head.empty() ? ": it is empty"
                                               : png        ? ": it is a PNG image"
                                               : pgm        ? ": it is a PGM image"
                                                            : ""));
  throw error.hint(hint).at(path);
}

/// @return nullptr for .apgm, and for what is called so: the reader then says what is wrong
const Converter* format_of_input(const std::string& path) {
  constexpr std::string_view kMagic =
      "\x89"
      "APGM";
  const std::string head = head_of(path);
  if (head.starts_with(kMagic)) return nullptr;
  const Converter* converter = converters::sniff(path, std::as_bytes(std::span(head)));
  if (path == "-") {
    if (converter == nullptr) return nullptr;
    throw Error(ErrorCode::kUnsupported, fmt::format("{} is not read from standard input", converter->name()))
        .hint("pass the file by its name");
  }
  if (converter == nullptr) converter = yaml_by_name(path, head);
  if (converter == nullptr && !has_suffix(path, ".apgm")) fail_unknown(path, head);
  return converter;
}

std::string format_name(const Converter* converter) {
  return converter == nullptr ? kApgm : std::string(converter->name());
}

Json formats_json() {
  Json formats = Json::array();
  formats.push_back({{"name", kApgm},
                     {"description", "adaptive patched grid maps"},
                     {"extensions", {".apgm"}},
                     {"reads", true},
                     {"writes", true},
                     {"settings", Json::array()},
                     {"losses", Json::array()}});
  for (const Converter* c : converters::all()) {
    Json settings = Json::array();
    for (const SettingSpec& s : c->settings()) {
      settings.push_back({{"key", s.key},
                          {"meaning", s.meaning},
                          {"default", s.default_value.empty() ? Json() : Json(s.default_value)},
                          {"for_reading", s.for_reading},
                          {"for_writing", s.for_writing}});
    }
    formats.push_back({{"name", c->name()},
                       {"description", c->description()},
                       {"extensions", c->extensions()},
                       {"reads", c->can_read()},
                       {"writes", c->can_write()},
                       {"settings", settings},
                       {"losses", c->losses()}});
  }
  return formats;
}

std::string formats_text(const Json& formats) {
  std::string text;
  for (const Json& format : formats) {
    const bool reads = format["reads"], writes = format["writes"];
    text += fmt::format("{}{}  {} ({}), {}\n", text.empty() ? "" : "\n", format["name"].get<std::string>(),
                        format["description"].get<std::string>(),
                        join(format["extensions"].get<std::vector<std::string>>(), " "),
                        reads ? (writes ? "reads and writes" : "reads") : "writes");
    TextTable settings({"  setting", "for", "default", "meaning"});
    for (const Json& s : format["settings"]) {
      const bool in = s["for_reading"], out = s["for_writing"];
      settings.add({"  " + s["key"].get<std::string>(), in ? (out ? "both" : "reading") : "writing",
                    s["default"].is_null() ? "" : s["default"].get<std::string>(), s["meaning"]});
    }
    if (!format["settings"].empty()) text += settings.text();
    for (const Json& loss : format["losses"]) text += "  lost: " + loss.get<std::string>() + "\n";
  }
  return text;
}

/// Thrown through the library on the first loss with --max-loss none.
struct LossRefused {
  std::string text;
};

class ConvertTool final : public Tool {
 public:
  ToolInfo info() const override {
    return {
        .verb = "convert",
        .summary = "convert maps between .apgm and other formats",
        .usage = "[OPTIONS] INPUT -o OUTPUT\n       apgm-convert --formats",
        .details = {"The input's format is told by its content, the output's by its extension. What a format "
                    "cannot hold is listed, and the exit code is then 3. From .apgm to .apgm layers are "
                    "copied as they are stored, unless --level or --lossy is given."},
        .examples = {{"apgm-convert building.bt -o building.apgm", "an OctoMap, columns projected"},
                     {"apgm-convert building.bt --set mode=slices -o building.apgm",
                      "an OctoMap, a layer for each height: nothing is lost"},
                     {"apgm-convert site.apgm --layer occupancy -o site.yaml", "for the nav2 map server"},
                     {"apgm-convert --level 12 site.apgm -o small.apgm", "the same map, packed harder"}},
        .exit_codes = {{kExitNo, "--max-loss none: data would be lost; nothing was written"},
                       {kExitLoss, "written, with loss that is listed"},
                       {kExitOutput, "the output exists, is not permitted, or the disk is full"},
                       {kExitLimit, "a limit of a format or the budget is met"},
                       {kExitIncompatible, "the map does not fit the output's format"}}};
  }

  void add_options(CLI::App& app) override {
    add_switch(app, kConversionGroup, "--formats", list_formats_,
               "list the formats, their settings and what they cannot hold");
    add_text(app, kConversionGroup, "--from", from_, "FORMAT", "format of the input (default: by content)");
    add_text(app, kConversionGroup, "--to", to_, "FORMAT", "format of the output (default: by extension)");
    add_list(app, kConversionGroup, "--set", set_, "KEY=VALUE", "a setting of a format (repeatable)");
    add_text(app, kConversionGroup, "--max-loss", max_loss_, "none|any",
             "none: write nothing and exit with 1 if data would be lost (default: any)");
    filter_.add(app);
    output_.add(app);
    writing_.add(app);
    heavy_.add(app);
  }

  void check(Session& session, const std::vector<std::string>& inputs) override {
    if (list_formats_) return;
    input_ = one_input(inputs);
    const std::optional<std::string> to = to_;
    if (from_) reader_ = format_named("--from", *from_, true);
    writer_ = to ? format_named("--to", *to, false) : nullptr;
    settings_ = parse_pairs("--set", set_);
    check_keys(keys_of_all(), "no format has");
    if (max_loss_) keep_all_ = parse_choice("--max-loss", *max_loss_, {"none", "any"}) == "none";
    filter_.check();
    writing_.check();
    heavy_.check();
    output_.check(session, {input_});
    if (!to) writer_ = format_of_output(output_.path);
    check_streams();
    check_values();
    if (writer_ != nullptr && !writing_.given().empty()) {
      throw usage_error(
          fmt::format("{} is for .apgm outputs, not for {}", writing_.given(), writer_->name()));
    }
  }

  void run(Session& session) override {
    if (list_formats_) {
      session.result()["formats"] = formats_json();
      return session.print(formats_text(session.result()["formats"]));
    }
    try {
      convert(session);
    } catch (const LossRefused& loss) {
      throw AnswerNo("the conversion would lose data: " + loss.text,
                     "nothing was written; --max-loss any accepts the loss");
    }
  }

 private:
  /// Keys that `use` of any format knows.
  static std::set<std::string> keys_of(const Converter* converter, bool reading) {
    std::set<std::string> keys;
    if (converter == nullptr) return keys;
    for (const SettingSpec& s : converter->settings()) {
      if (reading ? s.for_reading : s.for_writing) keys.insert(s.key);
    }
    return keys;
  }

  static std::set<std::string> keys_of_all() {
    std::set<std::string> keys;
    for (const Converter* c : converters::all()) {
      keys.merge(keys_of(c, true));
      keys.merge(keys_of(c, false));
    }
    return keys;
  }

  void check_keys(const std::set<std::string>& known, const std::string& who) const {
    const std::vector<std::string> names(known.begin(), known.end());
    for (const auto& [key, value] : settings_) {
      if (known.contains(key)) continue;
      throw usage_error(
          fmt::format("--set: {} a setting '{}'", who, key),
          names.empty() ? "it has no settings" : did_you_mean(key, names, "settings: " + join(names)));
    }
  }

  void check_streams() const {
    if (input_ == "-" && reader_ != nullptr) {
      throw usage_error(fmt::format("{} is not read from standard input", reader_->name()),
                        "pass the file by its name");
    }
    if (output_.path == "-" && writer_ != nullptr) {
      throw usage_error(fmt::format("{} is not written to standard output", writer_->name()),
                        "name a file with -o");
    }
  }

  void check_values_of(const Converter* reader) const {
    using converters::Use;
    if (reader != nullptr) reader->check_settings(settings_of(reader, true), Use::kReading);
    if (writer_ != nullptr) writer_->check_settings(settings_of(writer_, false), Use::kWriting);
  }

  /// Before the input is opened: values that no format it may have takes.
  void check_values() const {
    if (from_) return check_values_of(reader_);
    std::vector<const Converter*> readers{nullptr};
    for (const Converter* c : converters::all()) {
      if (c->can_read()) readers.push_back(c);
    }
    const Converter* likely = converters::for_extension(input_);
    std::stable_partition(readers.begin(), readers.end(), [&](const Converter* c) { return c == likely; });
    std::optional<Error> first;
    for (const Converter* reader : readers) {
      std::set<std::string> keys = keys_of(reader, true);
      keys.merge(keys_of(writer_, false));
      if (!std::all_of(settings_.begin(), settings_.end(),
                       [&](const auto& s) { return keys.contains(s.first); }))
        continue;
      try {
        return check_values_of(reader);
      } catch (const Error& error) {
        if (!first) first = error;
      }
    }
    if (first) throw *first;
  }

  /// Nothing that is written may be something that is read.
  void check_outputs(const std::vector<std::string>& written) const {
    std::vector<std::string> read{input_};
    if (reader_ != nullptr) read = reader_->files_read(input_);
    for (const auto& [key, value] : settings_) {
      if (names_file(key)) read.push_back(value);
    }
    for (const std::string& output : written) check_not_an_input(output, read);
  }

  bool names_file(const std::string& key) const {
    if (reader_ == nullptr) return false;
    const auto specs = reader_->settings();
    return std::any_of(specs.begin(), specs.end(),
                       [&](const SettingSpec& s) { return s.key == key && s.is_file; });
  }

  Settings settings_of(const Converter* converter, bool reading) const {
    const std::set<std::string> keys = keys_of(converter, reading);
    Settings own;
    for (const auto& pair : settings_) {
      if (keys.contains(pair.first)) own.insert(pair);
    }
    return own;
  }

  Findings findings(Session& session) const {
    if (!keep_all_) return session.findings();
    return [to_session = session.findings()](const Finding& finding) {
      if (finding.kind == Finding::Kind::kLoss) throw LossRefused{finding.text};
      to_session(finding);
    };
  }

  void convert(Session& session) {
    if (!from_) reader_ = format_of_input(input_);
    std::set<std::string> keys = keys_of(reader_, true);
    keys.merge(keys_of(writer_, false));
    check_keys(keys, fmt::format("from {} to {} there is not", format_name(reader_), format_name(writer_)));
    check_values_of(reader_);
    check_outputs({output_.path});
    const std::unique_ptr<PatchSource> source = open(session);
    step_opened(session, input_, *source);
    session.check_cancelled();
    const SourceView view(*source, filter_.layers, filter_.box);
    const PatchSource& part = filter_.any() ? static_cast<const PatchSource&>(view) : *source;
    session.result()["input"] = {
        {"path", input_},
        {"format", format_name(reader_)},
        {"content_id", source->content_id().empty() ? Json() : Json(source->content_id())}};
    session.result()["output_format"] = format_name(writer_);
    RunOptions run = session.run_options(heavy_, "converting");
    run.findings = findings(session);
    const converters::WriteRequest request = request_for(run);
    if (writer_ != nullptr) {
      check_outputs(writer_->files_written(part.header(), request));
      writer_->check_replaceable(part.header(), request);
    }
    if (output_.dry_run) return report_dry_run(session, output_);
    if (writer_ == nullptr) return write_map(session, *source, part, run);
    write_foreign(session, part, request);
  }

  converters::WriteRequest request_for(const RunOptions& run) const {
    const std::string layer = filter_.layers.size() == 1 ? filter_.layers.front() : "";
    return {output_.path, layer, settings_of(writer_, false), output_.options(), run};
  }

  std::unique_ptr<PatchSource> open(Session& session) const {
    if (reader_ == nullptr) return std::make_unique<Reader>(input_);
    return reader_->open({input_, settings_of(reader_, true), findings(session), heavy_.max_memory_bytes});
  }

  Provenance step(const PatchSource& source) const {
    Json parameters = Json::object();
    Settings told = settings_;
    std::erase_if(told, [&](const auto& s) { return names_file(s.first); });
    if (!told.empty()) parameters["set"] = told;
    if (!filter_.layers.empty()) parameters["layers"] = filter_.layers;
    if (filter_.box) parameters["bbox_m"] = box_json(*filter_.box);
    if (writing_.lossy != Lossy::kNone) parameters["lossy"] = writing_.lossy == Lossy::kU16 ? "u16" : "u8";
    const std::string id = source.content_id();
    return {"convert", {id.empty() ? format_name(reader_) : id}, parameters_text(parameters)};
  }

  void write_map(Session& session, const PatchSource& source, const PatchSource& part,
                 const RunOptions& run) {
    MapHeader header = part.header();
    writing_.apply(header, step(source));
    Writer writer(output_.path, header, writing_.options(output_));
    const CopyReport report = copy(part, header.types, writer, writing_.reencode(), run);
    session.check_cancelled();
    writer.finish();
    session.result()["layers_stored"] = report.layers_stored;
    session.step(fmt::format("{} of {} layers copied as stored", report.layers_stored, report.layers));
    report_written(session, output_, writer.report());
  }

  void write_foreign(Session& session, const PatchSource& part, const converters::WriteRequest& request) {
    const Summary summary = part.summary();
    writer_->write(part, request);
    if (summary.patches == 0) session.note("the result holds no patches");
    session.result()["output"] = output_.path;
    session.result()["dry_run"] = false;
    session.result()["patches"] = summary.patches;
    session.done(fmt::format("wrote '{}' ({}): {}", output_.path, writer_->name(),
                             plural(summary.patches, "patch", "patches")));
  }

  std::string input_;
  bool list_formats_ = false;
  bool keep_all_ = false;
  std::optional<std::string> from_, to_, max_loss_;
  std::vector<std::string> set_;
  Settings settings_;
  const Converter* reader_ = nullptr;  ///< nullptr: .apgm
  const Converter* writer_ = nullptr;
  Filter filter_;
  OutputChoice output_;
  MapWriting writing_;
  HeavyOptions heavy_;
};

}  // namespace
}  // namespace apgm::tools

int main(int argc, char** argv) {
  apgm::tools::ConvertTool tool;
  return apgm::tools::run_tool(tool, argc, argv);
}

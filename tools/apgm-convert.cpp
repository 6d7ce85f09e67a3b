#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <set>

#include "apgm/format/reader.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/ops/apply.hpp"
#include "apgm/ops/copy.hpp"
#include "tools/common/app.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/format_lookup.hpp"
#include "tools/common/input_head.hpp"
#include "tools/common/options.hpp"
#include "tools/common/report.hpp"
#include "tools/common/scratch.hpp"
#include "tools/common/source_view.hpp"
#include "tools/common/stream.hpp"
#include "tools/common/suggest.hpp"

namespace apgm::tools {
namespace {

using converters::Converter;
using converters::Settings;
using converters::SettingSpec;

constexpr const char* kStream = "stream";
constexpr const char* kConversionGroup = "Conversion";

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
                    "copied as they are stored, unless --level or --lossy is given.",
                    "A stream (.apgms, or --stream) is a map as blocks that are useful one by one, without "
                    "an index: "
                    "for pipes, sockets and datagrams. A stream that lacks a block or its end is refused, "
                    "unless --salvage is given: what is missing is then listed, and the exit code is 3."},
        .examples = {{"apgm-convert building.bt -o building.apgm", "an OctoMap, columns projected"},
                     {"apgm-convert building.bt --set mode=slices -o building.apgm",
                      "an OctoMap, a layer for each height: nothing is lost"},
                     {"apgm-convert site.apgm --layer occupancy -o site.yaml", "for the nav2 map server"},
                     {"apgm-convert --level 12 site.apgm -o small.apgm", "the same map, packed harder"},
                     {"apgm-convert site.apgm --stream -o - | ssh host apgm-convert - -o site.apgm",
                      "a map through a pipe"}},
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
    add_switch(app, kConversionGroup, "--salvage", salvage_,
               "keep what arrived of a stream that is not whole; what is missing is listed");
    stream_.add(app, kConversionGroup);
    filter_.add(app);
    output_.add(app);
    writing_.add(app);
    heavy_.add(app);
  }

  void check(Session& session, const std::vector<std::string>& inputs) override {
    if (list_formats_) return;
    input_ = one_input(inputs);
    const std::optional<std::string> to = to_;
    from_stream_ = from_ == kStream;
    if (from_ && !from_stream_) reader_ = format_named("--from", *from_, true);
    writer_ = to ? format_named("--to", *to, false) : nullptr;
    settings_ = parse_pairs("--set", set_);
    check_keys(keys_of_all(), "no format has");
    if (max_loss_) keep_all_ = parse_choice("--max-loss", *max_loss_, {"none", "any"}) == "none";
    filter_.check();
    writing_.check();
    heavy_.check();
    output_.check(session, {input_});
    if (!to && output_.path.ends_with(kStreamExtension)) stream_.on = true;
    stream_.check();
    if (!to && !stream_.on) writer_ = format_of_output(output_.path);
    if (stream_.on && writer_ != nullptr) {
      throw usage_error(fmt::format("--stream and --to {} name two formats", writer_->name()),
                        "pass one of them");
    }
    if (salvage_ && keep_all_) {
      throw usage_error("--salvage accepts loss, and --max-loss none refuses it", "pass one of them");
    }
    check_streams();
    check_values();
    if (writer_ == nullptr) warn_of_extension(session, output_.path, stream_.on ? kStreamExtension : ".apgm");
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
    if (!from_) {
      const InputFormat format = format_of_input(input_);
      reader_ = format.converter;
      from_stream_ = format.is_stream;
    }
    if (salvage_ && !from_stream_) {
      throw usage_error(fmt::format("--salvage is for streams, and '{}' is none", input_),
                        "'apgm-crop --salvage' keeps the whole layers of a damaged map");
    }
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
        {"format", from_stream_ ? kStream : format_name(reader_)},
        {"content_id", source->content_id().empty() ? Json() : Json(source->content_id())}};
    session.result()["output_format"] = stream_.on ? kStream : format_name(writer_);
    RunOptions run = session.run_options(heavy_, "converting");
    run.findings = findings(session);
    const converters::WriteRequest request = request_for(run);
    if (writer_ != nullptr) {
      check_outputs(writer_->files_written(part.header(), request));
      writer_->check_replaceable(part.header(), request);
    }
    if (output_.dry_run) return report_dry_run(session, output_);
    if (stream_.on) return write_stream(session, *source, part, run);
    if (writer_ == nullptr) return write_map(session, *source, part, run);
    write_foreign(session, part, request);
  }

  converters::WriteRequest request_for(const RunOptions& run) const {
    const std::string layer = filter_.layers.size() == 1 ? filter_.layers.front() : "";
    return {output_.path, layer, settings_of(writer_, false), output_.options(), run};
  }

  std::unique_ptr<PatchSource> open(Session& session) const {
    if (from_stream_) return read_stream(session, input_, scratch_directory(output_.path), salvage_);
    if (reader_ == nullptr) return std::make_unique<Reader>(input_);
    return reader_->open(
        {input_, settings_of(reader_, true), findings(session), session.memory_left(heavy_)});
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

  /// Of what is written. What does not hold all of a delta, to the bit, is none.
  MapHeader header_of(Session& session, const PatchSource& source, const PatchSource& part) const {
    MapHeader header = part.header();
    if (filter_.any() || writing_.lossy != Lossy::kNone) {
      warn_of_delta(session, input_, header);
      drop_changes(header);
    }
    writing_.apply(header, step(source));
    return header;
  }

  void write_map(Session& session, const PatchSource& source, const PatchSource& part,
                 const RunOptions& run) {
    const MapHeader header = header_of(session, source, part);
    Writer writer(output_.path, header, writing_.options(output_));
    const CopyReport report = copy(part, header.types, writer, writing_.reencode(), run);
    session.check_cancelled();
    writer.finish();
    session.result()["layers_stored"] = report.layers_stored;
    session.step(fmt::format("{} of {} layers copied as stored", report.layers_stored, report.layers));
    report_written(session, output_, writer.report());
  }

  void write_stream(Session& session, const PatchSource& source, const PatchSource& part,
                    const RunOptions& run) {
    const MapHeader header = header_of(session, source, part);
    StreamFile file(output_, header, stream_.options(writing_));
    copy(part, header.types, file.writer(), writing_.reencode(), run);
    session.check_cancelled();
    file.writer().finish();
    file.commit(session, output_);
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
  bool salvage_ = false;
  bool from_stream_ = false;
  StreamWriting stream_;
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

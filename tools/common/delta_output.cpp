#include "tools/common/delta_output.hpp"

#include <fmt/format.h>

#include <CLI/App.hpp>

#include "apgm/ops/apply.hpp"
#include "apgm/ops/copy.hpp"
#include "tools/common/exit_code.hpp"

namespace apgm::tools {
namespace {

constexpr const char* kGroup = "Delta";

}  // namespace

void DeltaOutput::add(CLI::App& app) {
  add_text(app, kGroup, "--delta", path_, "FILE",
           "also write what brings REF to OTHER, for 'apgm-merge --apply FILE REF'");
  stream_.add(app, kGroup);
}

void DeltaOutput::check(Session& session, const std::vector<std::string>& inputs, bool overwrite) {
  stream_.check();
  if (!path_) {
    if (stream_.on) throw usage_error("--stream is for deltas", "pass --delta FILE too");
    return;
  }
  if (path_->empty()) throw usage_error("--delta takes a file name, not an empty text");
  if (*path_ == "-") throw usage_error("--delta is not written to standard output", "name a file");
  check_output_path(*path_, overwrite, inputs);
  warn_of_extension(session, *path_, stream_.on ? ".apgms" : ".apgm");
  output_.path = *path_;
  output_.overwrite = overwrite;
}

void DeltaOutput::check_maps(const Reader& base, const Reader& other) const {
  if (!path_) return;
  for (const Reader* map : {&base, &other}) {
    if (!holds_changes(map->header())) continue;
    Error error(ErrorCode::kIncompatible, fmt::format("'{}' is itself a delta", map->path()));
    throw error.hint("'apgm-merge --apply' makes a map of a delta and its base").at(map->path());
  }
  if (base.header().frame == other.header().frame) return;
  throw Error(
      ErrorCode::kIncompatible,
      fmt::format("there is no delta between '{}' and '{}': their frames differ", base.path(), other.path()))
      .hint("both need the same datum, patch edge, EPSG code and frame id");
}

void DeltaOutput::write(Session& session, const Reader& base, const Reader& other,
                        const HeavyOptions& heavy) const {
  const RunOptions run = session.run_options(heavy, "writing the delta");
  RunOptions quiet = run;
  quiet.progress = {};
  const ChangesSource changes(base, other, quiet);
  const MessageEnd ids{base.content_id(), other.content_id()};
  std::uint64_t bytes = 0, layers = 0;
  if (stream_.on) {
    const StreamWritten written = write_stream(session, changes, ids, run);
    bytes = written.bytes;
    layers = written.layers;
  } else {
    const WriteReport written = write_file(session, changes, ids, run);
    bytes = written.file_bytes;
    layers = written.layers;
  }
  session.result()["delta"] = {{"path", path()},
                               {"bytes", bytes},
                               {"layers", layers},
                               {"layers_gone", changes.gone().size()},
                               {"base_content_id", ids.base},
                               {"result_content_id", ids.result},
                               {"stream", stream_.on}};
  session.done(fmt::format("wrote '{}': {} changed, {} gone, {}", path(), plural(layers, "layer", "layers"),
                           changes.gone().size(), size_text(bytes)));
}

WriteReport DeltaOutput::write_file(Session& session, const ChangesSource& changes, const MessageEnd& ids,
                                    const RunOptions& run) const {
  const MapHeader header = delta_header(changes, ids.base, ids.result);
  WriterOptions options;
  options.output = output_.options();
  Writer writer(path(), header, options);
  copy(changes, header.types, writer, false, run);
  session.check_cancelled();
  writer.finish();
  return writer.report();
}

StreamWritten DeltaOutput::write_stream(Session& session, const ChangesSource& changes, const MessageEnd& ids,
                                        const RunOptions& run) const {
  OutputFile file(path(), output_.options());
  StreamWriter writer([&](std::span<const std::byte> block) { file.write(block); }, changes.header(),
                      stream_.options({}));
  copy(changes, changes.header().types, writer, false, run);
  writer.gone(gone_by_name(changes));
  writer.end(ids);
  session.check_cancelled();
  file.commit();
  return writer.written();
}

}  // namespace apgm::tools

#include "tools/common/stream.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <limits>
#include <vector>

#include "tools/common/exit_code.hpp"
#include "tools/common/input_head.hpp"
#include "tools/common/parse.hpp"

namespace apgm::tools {
namespace {

constexpr std::size_t kReadBytes = std::size_t{1} << 18;

[[noreturn]] void fail(const std::string& path, ErrorCode code, const std::string& what,
                       const std::string& hint) {
  throw Error(code, fmt::format("'{}' {}", path, what)).hint(hint).at(path);
}

/// Gives all bytes of a file or of standard input to `handler`, as they arrive.
StreamReport receive(const Session& session, const std::string& path, StreamHandler& handler) {
  StreamReader reader(handler);
  const auto error_of = [&](const char* what) -> Error {
    const int error = errno;
    return Error(ErrorCode::kUnreadable, fmt::format("cannot {} '{}': {}", what, path, std::strerror(error)))
        .at(path);
  };
  const Descriptor input{path == "-" ? STDIN_FILENO : ::open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  if (input.fd < 0) throw error_of("open");
  std::vector<std::byte> buffer(kReadBytes);
  for (;;) {
    session.check_cancelled();
    const ssize_t got = ::read(input.fd, buffer.data(), buffer.size());
    if (got == 0) break;
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw error_of("read");
    reader.feed(std::span(buffer).first(static_cast<std::size_t>(got)));
  }
  reader.finish();
  return reader.report();
}

Json document(const StreamReport& r, std::uint64_t unusable) {
  return {{"blocks", r.blocks},
          {"blocks_damaged", r.damaged},
          {"blocks_duplicate", r.duplicate},
          {"blocks_incomplete", r.incomplete},
          {"blocks_late", r.late},
          {"blocks_lost", r.lost},
          {"blocks_unsupported", r.unsupported},
          {"blocks_without_header", r.without_header},
          {"bytes", r.bytes},
          {"bytes_skipped", r.skipped_bytes},
          {"ended", r.ended},
          {"gone", r.gone},
          {"layers", r.layers},
          {"layers_superseded", r.superseded},
          {"layers_unusable", unusable},
          {"messages", r.messages}};
}

/// What is missing, one line each.
std::vector<std::string> missing(const StreamReport& r, std::uint64_t unusable) {
  std::vector<std::string> lines;
  const auto add = [&](std::uint64_t count, const char* one, const char* many) {
    if (count > 0) lines.push_back(fmt::format("{} {}", count, count == 1 ? one : many));
  };
  add(r.lost, "block is lost", "blocks are lost");
  add(r.damaged, "block is damaged", "blocks are damaged");
  add(r.incomplete, "block lacks parts", "blocks lack parts");
  add(r.without_header, "block lacks its map header", "blocks lack their map header");
  add(r.late, "block came too late", "blocks came too late");
  add(r.unsupported, "block needs a newer version", "blocks need a newer version");
  add(r.skipped_bytes, "byte belongs to no whole block", "bytes belong to no whole block");
  add(unusable, "layer does not hold what its block says", "layers do not hold what their blocks say");
  if (!r.ended) lines.emplace_back("it ends in the middle of a message");
  return lines;
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += (text.empty() ? "" : ", ") + line;
  return text;
}

}  // namespace

void StreamWriting::add(CLI::App& app, const std::string& group) {
  add_switch(app, group, "--stream", on,
             "write a stream: blocks that are useful one by one, for pipes, sockets and datagrams");
  add_text(app, group, "--mtu", mtu_text_, "BYTES",
           "with --stream: no block is larger; larger ones are split (256 or more; default: no bound)");
}

void StreamWriting::check() {
  if (!mtu_text_) return;
  if (!on) throw usage_error("--mtu is for streams", "pass --stream too");
  mtu_bytes = static_cast<std::uint32_t>(parse_integer("--mtu", *mtu_text_, StreamOptions::kLeastMtu,
                                                       std::numeric_limits<std::int32_t>::max(),
                                                       "bytes of the largest datagram"));
}

StreamOptions StreamWriting::options(const MapWriting& writing) const {
  StreamOptions options;
  options.level = writing.level;
  options.lossy = writing.lossy;
  options.mtu_bytes = mtu_bytes;
  return options;
}

StreamFile::StreamFile(const OutputChoice& output, const MapHeader& header, const StreamOptions& options)
    : file_(output.path, output.options()),
      writer_([this](std::span<const std::byte> block) { file_.write(block); }, header, options) {}

void StreamFile::commit(Session& session, const OutputChoice& output) {
  file_.commit();
  const StreamWritten& written = writer_.written();
  Json& result = session.result();
  result["output"] = output.path;
  result["dry_run"] = false;
  result["bytes"] = written.bytes;
  result["blocks"] = written.blocks;
  result["messages"] = written.messages;
  result["layers"] = written.layers;
  result["gone"] = written.gone;
  result["content_id"] = written.content_id.empty() ? Json() : Json(written.content_id);
  session.done(fmt::format("wrote '{}': {}, {}, {}", output.path, plural(written.blocks, "block", "blocks"),
                           plural(written.layers, "layer", "layers"), size_text(written.bytes)));
}

std::unique_ptr<StreamMap> read_stream(Session& session, const std::string& path, const std::string& scratch,
                                       bool salvage) {
  auto map = std::make_unique<StreamMap>(scratch);
  const StreamReport report = receive(session, path, *map);
  session.result()["stream"] = document(report, map->unusable());
  const auto refuse = [&](ErrorCode code, const std::string& what, const char* hint) {
    fail(path, code, what, hint);
  };
  if (!map->has_header()) {
    refuse(report.unsupported > 0 ? ErrorCode::kUnsupported : ErrorCode::kDamaged,
           report.fault.empty() ? "holds no map" : "holds no map that can be read: " + report.fault,
           "send it again, or ask the sender for its map header more often");
  }
  std::vector<std::string> lost = missing(report, map->unusable());
  if (report.duplicate + report.superseded > 0) {
    session.step(fmt::format("'{}': {} again, {} after a newer state", path,
                             plural(report.duplicate, "block came", "blocks came"),
                             plural(report.superseded, "layer came", "layers came")));
  }
  if (lost.empty() && map->is_as_said() == false) {
    lost.emplace_back("what arrived is not the map that was sent");
  }
  if (!map->base().empty()) {
    const std::string what = "holds changes of map " + map->base() + ", not a map";
    if (!salvage) {
      refuse(ErrorCode::kIncompatible, what,
             "'apgm-merge --apply' brings that map up to date; --salvage makes a map of what changed");
    }
    session.loss(fmt::format("'{}' {}", path, what));
  } else if (!lost.empty() && !salvage) {
    refuse(ErrorCode::kDamaged, "is not whole: " + joined(lost), "--salvage keeps what arrived");
  }
  for (const std::string& line : lost) session.loss(fmt::format("'{}': {}", path, line));
  return map;
}

std::unique_ptr<StreamMap> apply_stream(Session& session, const PatchSource& base, const ApplyNames& names,
                                        const std::string& scratch, Json& result) {
  const std::string& path = names.delta;
  auto map = std::make_unique<StreamMap>(scratch);
  map->start_from(base);
  const StreamReport report = receive(session, path, *map);
  result["stream"] = document(report, map->unusable());
  const std::vector<std::string> lost = missing(report, map->unusable());
  if (!lost.empty()) {
    fail(path, report.unsupported > 0 ? ErrorCode::kUnsupported : ErrorCode::kDamaged,
         "is not whole: " + joined(lost), "send it again: nothing is applied of a part");
  }
  if (map->base().empty()) {
    fail(path, ErrorCode::kForeign, "is not a delta: the stream names no map that it changes",
         "'apgm-diff REF OTHER --delta FILE --stream' makes one; 'apgm-convert' makes a map of a whole one");
  }
  check_base(base, map->base(), map->result(), names);
  if (map->result().empty()) {
    fail(path, ErrorCode::kDamaged, "does not say which map it leads to: what it gives cannot be checked",
         "the sender has to name the result at the end of its message (StreamWriter::end)");
  }
  if (map->is_as_said() == false) {
    fail(path, ErrorCode::kDamaged,
         fmt::format("is not the delta it says it is: it gives content {}, not {}", map->content_id(),
                     map->result()),
         "'apgm-verify' finds out whether the base is damaged");
  }
  return map;
}

}  // namespace apgm::tools

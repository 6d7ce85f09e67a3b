#include "dump.hpp"

#include <array>
#include <bit>
#include <cstdio>
#include <cstring>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/format/stream.hpp"
#include "apgm/format/stream_map.hpp"
#include "sha256.hpp"
#include "temp_dir.hpp"

namespace apgm::test {
namespace {

using nlohmann::json;

constexpr std::array<const char*, 5> kEncodings{"constant", "masked32", "palette", "masked16", "masked8"};
/// A dump of more layers holds a digest of their lines.
constexpr std::size_t kListedLayers = 100;

std::string hex(std::uint64_t value, int digits) {
  std::array<char, 17> text{};
  std::snprintf(text.data(), text.size(), "%0*llx", digits, static_cast<unsigned long long>(value));
  return text.data();
}

json dump_type(const LayerType& type) {
  json slab;
  if (type.slab) slab = {type.slab->z_min_um, type.slab->z_max_um};
  return {{"name", type.name},
          {"hypotheses", type.hypotheses},
          {"channels", type.channels},
          {"policy", to_string(type.policy)},
          {"slab_um", slab}};
}

json dump_header(const MapHeader& header) {
  const Frame& f = header.frame;
  json types = json::array(), history = json::array(), epsg;
  for (const LayerType& type : header.types) types.push_back(dump_type(type));
  for (const Provenance& p : header.history) {
    history.push_back({{"operation", p.operation}, {"inputs", p.inputs}, {"parameters", p.parameters}});
  }
  if (f.epsg) epsg = *f.epsg;
  return {{"edge_um", f.edge_um},
          {"datum_um", {f.datum_x_um, f.datum_y_um}},
          {"epsg", epsg},
          {"frame_id", f.frame_id},
          {"stamp_ns", header.stamp_ns},
          {"types", types},
          {"metadata", json::object_t(header.metadata.begin(), header.metadata.end())},
          {"history", history}};
}

json dump_layer(const LayerInfo& info, const LayerType& type, const Layer& layer) {
  std::vector<std::byte> cells;
  for (int c = 0; c < layer.channels(); ++c) {
    const auto plane = std::as_bytes(layer.plane(c));
    cells.insert(cells.end(), plane.begin(), plane.end());
  }
  return {{"patch", {info.patch.x, info.patch.y}},
          {"type", type.name},
          {"step", layer.step()},
          {"encoding", kEncodings.at(info.encoding)},
          {"stamp_ns", layer.stamp_ns},
          {"error_bound", hex(std::bit_cast<std::uint32_t>(layer.error_bound), 8)},
          {"content_hash", hex(info.content_hash, 16)},
          {"cells", sha256(cells)}};
}

/// A layer of the dump as one line, for the digest of many.
std::string line_of(const json& layer) {
  std::string line = layer["patch"][0].dump() + " " + layer["patch"][1].dump();
  for (const char* key : {"type", "step", "encoding", "stamp_ns", "error_bound", "content_hash", "cells"}) {
    const json& value = layer[key];
    line += " " + (value.is_string() ? value.get<std::string>() : value.dump());
  }
  return line + "\n";
}

struct Layers {
  json list = json::array();
  std::string lines;
};

Layers layers_of(const PatchSource& map) {
  Layers layers;
  const auto cursor = map.patches();
  PatchInfo patch;
  Layer layer;
  while (cursor->next(patch)) {
    for (const LayerInfo& info : patch.layers) {
      map.load(info, layer);
      layers.list.push_back(dump_layer(info, map.header().types[info.type], layer));
      layers.lines += line_of(layers.list.back());
    }
  }
  return layers;
}

std::string digest(const Layers& layers) { return sha256(std::as_bytes(std::span(layers.lines))); }

json dump_map(const PatchSource& map) {
  const Summary summary = map.summary();
  const Layers layers = layers_of(map);
  json out{{"content_id", map.content_id()},
           {"header", dump_header(map.header())},
           {"patches", summary.patches},
           {"range", {summary.range.min.x, summary.range.min.y, summary.range.max.x, summary.range.max.y}},
           {"layers", layers.list.size()}};
  if (layers.list.size() <= kListedLayers) {
    out["list"] = layers.list;
  } else {
    out["list_sha256"] = digest(layers);
  }
  return out;
}

/// Notes the ends of messages, and makes the map.
struct Receiver final : StreamHandler {
  void header(const MapHeader& header) override { map.header(header); }
  void layer(const StreamLayer& layer) override { map.layer(layer); }
  void gone(const StreamGone& gone) override { map.gone(gone); }
  void end(const StreamEnd& end) override {
    map.end(end);
    ends.push_back({{"base", end.ids.base},
                    {"result", end.ids.result},
                    {"whole", end.whole},
                    {"layers", end.layers},
                    {"gone", end.gone},
                    {"missing", end.missing}});
  }

  TempDir dir;
  StreamMap map{dir.path()};
  json ends = json::array();
};

template <typename Work>
json result_of_work(Work work) {
  try {
    return work();
  } catch (const Error& e) {
    return {{"refused", to_string(e.code())}};
  }
}

}  // namespace

json dump(const Reader& reader) {
  json out = dump_map(reader);
  out["version"] = {reader.file().version_major, reader.file().version_minor};
  out["bytes"] = reader.file().file_bytes;
  return out;
}

json dump_archive(const std::string& path) {
  const Reader last(path);
  json out = dump(last);
  out["uncommitted_bytes"] = last.file().uncommitted_bytes;
  json commits = json::array();
  for (const CommitInfo& info : last.commits()) {
    const Reader reader(path, {.commit = info.number});
    commits.push_back({{"number", info.number},
                       {"content_id", info.content_id},
                       {"stamp_ns", info.stamp_ns},
                       {"patches", info.patches},
                       {"layers", info.layers},
                       {"added_bytes", info.added_bytes},
                       {"message", info.message},
                       {"tags", info.tags},
                       {"list_sha256", digest(layers_of(reader))}});
  }
  out["commits"] = commits;
  return out;
}

json dump_stream(const std::string& path) {
  Receiver receiver;
  StreamReader reader(receiver);
  const std::string bytes = read_file(path);
  reader.feed(std::as_bytes(std::span(bytes)));
  reader.finish();
  const StreamReport r = reader.report();
  json as_said;
  if (const auto said = receiver.map.is_as_said()) as_said = *said;
  return {{"bytes", r.bytes},
          {"complete", r.complete()},
          {"as_said", as_said},
          {"ends", receiver.ends},
          {"map", receiver.map.has_header() ? dump_map(receiver.map) : json()},
          {"counts",
           {{"blocks", r.blocks},
            {"messages", r.messages},
            {"layers", r.layers},
            {"gone", r.gone},
            {"damaged", r.damaged},
            {"lost", r.lost},
            {"duplicate", r.duplicate},
            {"late", r.late},
            {"superseded", r.superseded},
            {"incomplete", r.incomplete},
            {"without_header", r.without_header},
            {"unsupported", r.unsupported},
            {"skipped_bytes", r.skipped_bytes},
            {"unusable", receiver.map.unusable()}}}};
}

json result_of_archive(const std::string& path) {
  return result_of_work([&] { return dump_archive(path); });
}

json result_of(const std::string& path) {
  return result_of_work([&] { return dump(Reader(path)); });
}

}  // namespace apgm::test

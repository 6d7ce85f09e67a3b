#include "dump.hpp"

#include <array>
#include <bit>
#include <cstdio>
#include <cstring>
#include <vector>

#include "apgm/core/error.hpp"
#include "sha256.hpp"

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

}  // namespace

json dump(const Reader& reader) {
  const Summary summary = reader.summary();
  json layers = json::array();
  std::string lines;
  const auto cursor = reader.patches();
  PatchInfo patch;
  Layer layer;
  while (cursor->next(patch)) {
    for (const LayerInfo& info : patch.layers) {
      reader.load(info, layer);
      layers.push_back(dump_layer(info, reader.header().types[info.type], layer));
      lines += line_of(layers.back());
    }
  }
  json out{{"version", {reader.file().version_major, reader.file().version_minor}},
           {"bytes", reader.file().file_bytes},
           {"content_id", reader.content_id()},
           {"header", dump_header(reader.header())},
           {"patches", summary.patches},
           {"range", {summary.range.min.x, summary.range.min.y, summary.range.max.x, summary.range.max.y}},
           {"layers", layers.size()}};
  if (layers.size() <= kListedLayers) {
    out["list"] = layers;
  } else {
    out["list_sha256"] = sha256(std::as_bytes(std::span(lines)));
  }
  return out;
}

json result_of(const std::string& path) {
  try {
    return dump(Reader(path));
  } catch (const Error& e) {
    return {{"refused", to_string(e.code())}};
  }
}

}  // namespace apgm::test

#include "apgm/ops/crop.hpp"

#include "apgm/ops/apply.hpp"
#include "provenance.hpp"
#include "region.hpp"
#include "transfer.hpp"

namespace apgm {
namespace {

TypeTable chosen_types(const TypeTable& types, const std::vector<std::string>& names) {
  if (names.empty()) return types;
  std::string known;
  for (const LayerType& type : types) known += (known.empty() ? "" : ", ") + type.name;
  std::vector<bool> chosen(types.size());
  for (const std::string& name : names) {
    const auto id = types.find(name);
    if (!id) {
      throw Error(ErrorCode::kInvalidArgument, "the map has no layer '" + name + "'")
          .hint(known.empty() ? "the map has no layers" : "it has: " + known);
    }
    chosen[*id] = true;
  }
  std::vector<LayerType> kept;
  for (std::size_t id = 0; id < types.size(); ++id) {
    if (chosen[id]) kept.push_back(types[static_cast<TypeId>(id)]);
  }
  return TypeTable(std::move(kept));
}

std::string ring_json(const std::vector<Point>& ring) {
  std::vector<std::string> corners;
  for (const Point& p : ring) {
    const std::string xy[] = {ops::json_number(p.x_m), ops::json_number(p.y_m)};
    corners.push_back(ops::json_list(xy));
  }
  return ops::json_list(corners);
}

/// Rings above this many corners are told by their number only: the history is to stay small.
constexpr std::size_t kMaxCornersTold = 64;

std::string parameters_json(const CropRegion& region, const CropOptions& options) {
  std::map<std::string, std::string> members;
  members["snap"] = options.snap == Snap::kCell ? "\"cell\"" : "\"patch\"";
  if (options.salvage) members["salvage"] = "true";
  if (region.box) {
    const Box& box = *region.box;
    const std::string corners[] = {ops::json_number(box.min.x_m), ops::json_number(box.min.y_m),
                                   ops::json_number(box.max.x_m), ops::json_number(box.max.y_m)};
    members["bbox_m"] = ops::json_list(corners);
  }
  if (region.polygon) {
    std::size_t corners = 0;
    std::vector<std::string> rings;
    for (const auto& ring : region.polygon->rings) corners += ring.size();
    if (corners <= kMaxCornersTold) {
      for (const auto& ring : region.polygon->rings) rings.push_back(ring_json(ring));
      members["polygon_m"] = ops::json_list(rings);
    } else {
      members["polygon_corners"] = std::to_string(corners);
    }
  }
  if (!options.layers.empty()) {
    std::vector<std::string> names;
    for (const std::string& name : options.layers) names.push_back(ops::json_text(name));
    members["layers"] = ops::json_list(names);
  }
  return ops::json_object(members);
}

void check_like(const PatchSource& source, const CropRegion& region) {
  if (region.like == nullptr || region.like->header().frame == source.header().frame) return;
  throw Error(ErrorCode::kIncompatible, "the map to crop and the map to crop it like have different frames")
      .hint("both need the same datum, edge, EPSG code and frame id");
}

}  // namespace

MapHeader crop_header(const PatchSource& source, const CropRegion& region, const CropOptions& options) {
  check_like(source, region);
  const ops::Region checked(region, options.snap, source.header().frame);
  MapHeader header = source.header();
  drop_changes(header);
  header.types = chosen_types(header.types, options.layers);
  Provenance step{"crop", {ops::input_id(source)}, parameters_json(region, options)};
  if (region.like != nullptr) step.inputs.push_back(ops::input_id(*region.like));
  header.history.push_back(std::move(step));
  return header;
}

CropReport crop(const PatchSource& source, const CropRegion& region, const CropOptions& options,
                PatchSink& sink, const RunOptions& run) {
  check_like(source, region);
  const TypeTable types = chosen_types(source.header().types, options.layers);
  const ops::Region area(region, options.snap, source.header().frame);
  ops::Transfer transfer(source, types, sink);
  transfer.region = &area;
  transfer.like = region.like;
  transfer.salvage = options.salvage;
  const ops::TransferReport report = transfer.run(run);
  return {report.patches, report.layers, report.layers_stored, report.damaged};
}

}  // namespace apgm

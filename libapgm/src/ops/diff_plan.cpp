#include "diff_plan.hpp"

#include <algorithm>
#include <utility>

#include "apgm/core/summary.hpp"
#include "provenance.hpp"
#include "shifted_source.hpp"

namespace apgm::ops {
namespace {

std::string metres(std::int64_t um) { return json_number(static_cast<double>(um) / 1e6); }
std::string datum_text(const Frame& f) { return metres(f.datum_x_um) + "," + metres(f.datum_y_um); }

const MapHeader& header_of(const DiffInput& input) { return input.source->header(); }

[[noreturn]] void fail(const DiffInput& a, const DiffInput& b, const std::string& why, std::string hint) {
  throw Error(ErrorCode::kIncompatible, "cannot compare '" + a.name + "' and '" + b.name + "': " + why)
      .hint(std::move(hint));
}

std::string regrid_hint(const Frame& to, const DiffInput& b) {
  return "bring '" + b.name + "' to the same grid first: apgm-resample --edge " + metres(to.edge_um) +
         " --datum " + datum_text(to);
}

void check_options(const DiffOptions& options) {
  if (!(options.tolerance >= 0)) {
    throw Error(ErrorCode::kInvalidArgument, "the tolerance is not a number from 0 on");
  }
  if (options.level == DiffLevel::kBytes && (options.regions || options.cells != nullptr)) {
    throw Error(ErrorCode::kInvalidArgument, "regions and cells cannot be told without reading cells");
  }
}

void check_frames(const DiffInput& a, const DiffInput& b, DiffPlan& plan) {
  const Frame &f = header_of(a).frame, &g = header_of(b).frame;
  if (f.frame_id != g.frame_id) {
    fail(a, b, "frames differ ('" + f.frame_id + "' and '" + g.frame_id + "')",
         "if they are the same, 'apgm-merge --assume-frame " + f.frame_id + "' renames that of '" + b.name +
             "'");
  }
  if (f.epsg && g.epsg && *f.epsg != *g.epsg) {
    fail(a, b,
         "coordinate reference systems differ (EPSG " + std::to_string(*f.epsg) + " and " +
             std::to_string(*g.epsg) + ")",
         "bring them to one coordinate reference system first");
  }
  if (f.epsg.has_value() != g.epsg.has_value()) {
    plan.findings.push_back({Finding::Kind::kNote, "'" + (f.epsg ? b : a).name +
                                                       "' does not say its EPSG code; taken as " +
                                                       std::to_string(f.epsg ? *f.epsg : *g.epsg)});
  }
  if (f.edge_um == g.edge_um) return;
  fail(a, b, "patch edges differ (" + metres(f.edge_um) + " m and " + metres(g.edge_um) + " m)",
       regrid_hint(f, b));
}

void align(const DiffInput& a, const DiffInput& b, DiffPlan& plan) {
  const Frame &f = header_of(a).frame, &g = header_of(b).frame;
  plan.reference = a.source;
  plan.other = b.source;
  if (f.datum_x_um == g.datum_x_um && f.datum_y_um == g.datum_y_um) return;
  const auto offset = whole_cells(g, f, coarsest_step(b.source->summary()).value_or(kMaxStep));
  if (!offset) {
    fail(a, b,
         "datums differ by other than whole cells (" + datum_text(f) + " m and " + datum_text(g) + " m)",
         regrid_hint(f, b));
  }
  Frame target = g;
  target.datum_x_um = f.datum_x_um;
  target.datum_y_um = f.datum_y_um;
  plan.adapter = std::make_unique<ShiftedSource>(*b.source, target, *offset);
  plan.other = plan.adapter.get();
  plan.findings.push_back({Finding::Kind::kNote, "datums differ by whole cells: '" + b.name +
                                                     "' is compared on the grid of '" + a.name + "'"});
}

/// One table of the types of both maps, those that are asked for.
void join_types(const DiffInput& a, const DiffInput& b, const DiffOptions& options, DiffPlan& plan) {
  const TypeTable &left = header_of(a).types, &right = header_of(b).types;
  const auto wanted = [&](const LayerType& type) {
    return options.layers.empty() || std::ranges::find(options.layers, type.name) != options.layers.end();
  };
  std::vector<LayerType> all;
  for (const LayerType& type : left) {
    if (!wanted(type)) continue;
    all.push_back(type);
    const auto twin = right.find(type.name);
    if (!twin || right[*twin].same_meaning(type)) continue;
    fail(a, b, "layer '" + type.name + "' stands for other hypotheses, channels or heights",
         "name the layers to compare with --layer");
  }
  for (const LayerType& type : right) {
    if (wanted(type) && !left.find(type.name)) all.push_back(type);
  }
  plan.types = TypeTable(std::move(all));
  for (const LayerType& type : left) plan.of_reference.push_back(plan.types.find(type.name));
  for (const LayerType& type : right) plan.of_other.push_back(plan.types.find(type.name));
}

TypeId existing(const std::string& name, const DiffInput& a, const DiffInput& b, const DiffPlan& plan) {
  if (const auto id = plan.types.find(name)) return *id;
  std::string names;
  for (const DiffInput* input : {&a, &b}) {
    for (const LayerType& type : header_of(*input).types) {
      if (input == &b && header_of(a).types.find(type.name)) continue;
      names += (names.empty() ? "" : ", ") + type.name;
    }
  }
  throw Error(ErrorCode::kInvalidArgument,
              "neither '" + a.name + "' nor '" + b.name + "' has a layer '" + name + "'")
      .hint(names.empty() ? "they have no layers" : "their layers: " + names);
}

void compare_metadata(const MapHeader& a, const MapHeader& b, std::vector<std::string>& out) {
  for (const auto& [key, value] : a.metadata) {
    const auto it = b.metadata.find(key);
    if (it == b.metadata.end() || it->second != value) out.push_back("metadata '" + key + "'");
  }
  for (const auto& [key, value] : b.metadata) {
    if (!a.metadata.contains(key)) out.push_back("metadata '" + key + "'");
  }
}

/// What the headers tell beside the cells, where it differs.
std::vector<std::string> header_differences(const MapHeader& a, const MapHeader& b, const TypeTable& types) {
  std::vector<std::string> out;
  const Frame &f = a.frame, &g = b.frame;
  if (f.datum_x_um != g.datum_x_um || f.datum_y_um != g.datum_y_um) out.emplace_back("datum");
  if (f.epsg != g.epsg) out.emplace_back("EPSG code");
  if (a.history != b.history) out.emplace_back("history");
  compare_metadata(a, b, out);
  if (a.stamp_ns != b.stamp_ns) out.emplace_back("stamp");
  for (const LayerType& type : types) {
    const auto left = a.types.find(type.name), right = b.types.find(type.name);
    if (!left || !right) {
      out.push_back("declaration of layer '" + type.name + "'");
    } else if (a.types[*left].policy != b.types[*right].policy) {
      out.push_back("policy of layer '" + type.name + "'");
    }
  }
  return out;
}

}  // namespace

DiffPlan plan_diff(const DiffInput& reference, const DiffInput& other, const DiffOptions& options) {
  check_options(options);
  DiffPlan plan;
  check_frames(reference, other, plan);
  join_types(reference, other, options, plan);
  for (const std::string& name : options.layers) (void)existing(name, reference, other, plan);
  if (options.cells != nullptr) plan.drawn = existing(options.cells_layer, reference, other, plan);
  if (options.box) plan.range = header_of(reference).frame.patches_meeting(*options.box);
  plan.header_differences = header_differences(header_of(reference), header_of(other), plan.types);
  align(reference, other, plan);
  return plan;
}

}  // namespace apgm::ops

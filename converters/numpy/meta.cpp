#include "converters/numpy/meta.hpp"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <tuple>

#include "converters/common/settings.hpp"

namespace apgm::converters {
namespace {

using Json = nlohmann::json;
constexpr const char* kFormat = "apgm.numpy/1";

constexpr const char* kSeeDocs = "docs/converters.md says what stands beside the arrays";

[[noreturn]] void fail(const std::string& key, const std::string& why, const char* hint = kSeeDocs) {
  throw Error(ErrorCode::kDamaged, "its JSON: '" + key + "' " + why).hint(hint);
}

const Json& need(const Json& object, const std::string& key) {
  const auto it = object.find(key);
  if (it == object.end()) fail(key, "is missing");
  return *it;
}

std::int64_t whole(const Json& object, const std::string& key, std::int64_t low, std::int64_t high) {
  const Json& value = need(object, key);
  const bool fits =
      value.is_number_unsigned()
          ? value.get<std::uint64_t>() <= static_cast<std::uint64_t>(std::max<std::int64_t>(high, 0))
          : value.is_number_integer();
  if (!fits || value.get<std::int64_t>() < low || value.get<std::int64_t>() > high) {
    fail(key, "is no whole number in " + std::to_string(low) + ".." + std::to_string(high));
  }
  return value.get<std::int64_t>();
}

std::string text(const Json& object, const std::string& key) {
  const Json& value = need(object, key);
  if (!value.is_string()) fail(key, "is no text");
  return value.get<std::string>();
}

std::vector<std::string> texts(const Json& object, const std::string& key) {
  const Json& value = need(object, key);
  if (!value.is_array() || value.size() > 16) fail(key, "is no list of at most 16 texts");
  std::vector<std::string> list;
  for (const Json& item : value) {
    if (!item.is_string()) fail(key, "is no list of at most 16 texts");
    list.push_back(item.get<std::string>());
  }
  return list;
}

/// Two whole numbers in a list.
std::pair<std::int64_t, std::int64_t> pair_of(const Json& object, const std::string& key, std::int64_t most) {
  const Json& value = need(object, key);
  if (!value.is_array() || value.size() != 2) fail(key, "is no pair of whole numbers");
  const Json named{{key, value[0]}}, second{{key, value[1]}};
  return {whole(named, key, -most, most), whole(second, key, -most, most)};
}

/// What does not fit is the file's fault here, not the caller's.
template <class Check>
void valid(Check check) {
  try {
    check();
  } catch (const Error& error) {
    throw Error(ErrorCode::kDamaged, "its JSON: " + error.message())
        .hint(error.hint().empty() ? kSeeDocs : error.hint());
  }
}

/// Missing or null: unknown.
std::optional<std::int32_t> epsg_of(const Json& object) {
  const auto it = object.find("epsg");
  if (it == object.end() || it->is_null()) return {};
  constexpr std::int64_t kMostCode = 999'999;
  if (!it->is_number_integer() || *it < 1 || *it > kMostCode) {
    fail("epsg", "is no whole number in 1.." + std::to_string(kMostCode) + " and not null",
         "null, or no 'epsg', stands for coordinates without an EPSG code");
  }
  return it->get<std::int32_t>();
}

Frame frame_of(const Json& object) {
  if (!object.is_object()) fail("frame", "is no object");
  Frame frame;
  frame.frame_id = text(object, "frame_id");
  frame.edge_um = whole(object, "edge_um", 0, std::int64_t{1} << 62);
  std::tie(frame.datum_x_um, frame.datum_y_um) = pair_of(object, "datum_um", std::int64_t{1} << 62);
  frame.epsg = epsg_of(object);
  return frame;
}

ArrayMeta array_of(const Json& object) {
  if (!object.is_object()) fail("layers", "is no list of objects");
  ArrayMeta array;
  array.array = text(object, "array");
  array.type.name = text(object, "layer");
  array.type.hypotheses = texts(object, "hypotheses");
  array.type.channels = texts(object, "channels");
  const auto policy = policy_from(text(object, "policy"));
  if (!policy) fail("policy", "names no policy");
  array.type.policy = *policy;
  if (object.contains("slab_um")) {
    const auto [low, high] = pair_of(object, "slab_um", std::int64_t{1} << 62);
    array.type.slab = Slab{low, high};
  }
  array.step = static_cast<int>(whole(object, "step", 0, kMaxStep));
  std::tie(array.cell_x, array.cell_y) = pair_of(object, "first_cell", std::int64_t{1} << 43);
  valid([&] { array.type.check(); });
  return array;
}

Json json_of(const ArrayMeta& array, const Frame& frame) {
  const double cell = frame.cell_m(array.step);
  const Point datum = frame.datum_m();
  Json object{{"array", array.array},
              {"layer", array.type.name},
              {"hypotheses", array.type.hypotheses},
              {"channels", array.type.channels},
              {"policy", to_string(array.type.policy)},
              {"step", array.step},
              {"first_cell", {array.cell_x, array.cell_y}},
              // For people; a reader takes the whole numbers.
              {"cell_m", cell},
              {"corner_m",
               {datum.x_m + static_cast<double>(array.cell_x) * cell,
                datum.y_m + static_cast<double>(array.cell_y) * cell}}};
  if (array.type.slab) object["slab_um"] = {array.type.slab->z_min_um, array.type.slab->z_max_um};
  return object;
}

}  // namespace

std::string to_json(const NumpyMeta& meta) {
  Json arrays = Json::array();
  for (const ArrayMeta& array : meta.arrays) arrays.push_back(json_of(array, meta.frame));
  const Frame& f = meta.frame;
  const Json object{{"format", kFormat},
                    {"axes", {"channel", "row from south", "column from west"}},
                    {"frame",
                     {{"frame_id", f.frame_id},
                      {"epsg", f.epsg ? Json(*f.epsg) : Json()},
                      {"edge_um", f.edge_um},
                      {"datum_um", {f.datum_x_um, f.datum_y_um}}}},
                    {"stamp_ns", meta.stamp_ns},
                    {"layers", arrays}};
  return object.dump(1) + "\n";
}

NumpyMeta from_json(const std::string& text_of_file) {
  const Json object = Json::parse(text_of_file, nullptr, false);
  if (!object.is_object() || !object.contains("format")) {
    throw Error(ErrorCode::kForeign, "its JSON is not that of a map").hint(kSeeDocs);
  }
  if (text(object, "format") != kFormat) {
    throw Error(ErrorCode::kUnsupported, "its JSON has format '" + printable(text(object, "format")) +
                                             "', this reader knows '" + kFormat + "'")
        .hint(kSeeDocs);
  }
  NumpyMeta meta;
  meta.frame = frame_of(need(object, "frame"));
  valid([&] { meta.frame.check(); });
  const std::int64_t most = std::numeric_limits<std::int64_t>::max();
  if (object.contains("stamp_ns")) meta.stamp_ns = whole(object, "stamp_ns", -most, most);
  const Json& arrays = need(object, "layers");
  if (!arrays.is_array()) fail("layers", "is no list of objects");
  if (arrays.size() > TypeTable::kMaxTypes) {
    throw Error(ErrorCode::kLimit, "its JSON names more than 4096 arrays").hint("write several files");
  }
  for (const Json& array : arrays) meta.arrays.push_back(array_of(array));
  return meta;
}

}  // namespace apgm::converters

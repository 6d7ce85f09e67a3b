#include "converters/geotiff/tags.hpp"

#include <charconv>

#include "converters/common/settings.hpp"

namespace apgm::converters {
namespace {

using Items = std::map<std::string, std::string>;
constexpr std::string_view kVersion = "1";

std::string join(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  return text;
}

std::vector<std::string> split(std::string_view text, char at) {
  std::vector<std::string> parts;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(at), text.size());
    parts.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return parts;
}

[[noreturn]] void fail(const std::string& key, const std::string& why) {
  throw Error(ErrorCode::kDamaged, "metadata item '" + key + "' of domain 'APGM' " + why)
      .hint("without that domain the raster can be read with as=masses, classes, probability or value");
}

const std::string& need(const Items& items, const std::string& key) {
  const auto it = items.find(key);
  if (it == items.end()) fail(key, "is missing");
  return it->second;
}

std::int64_t whole(const std::string& key, std::string_view text) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) {
    fail(key, "is no whole number: '" + printable(text) + "'");
  }
  return value;
}

std::vector<std::int64_t> wholes(const Items& items, const std::string& key, std::size_t count) {
  std::vector<std::int64_t> values;
  for (const std::string& word : split(need(items, key), ' ')) values.push_back(whole(key, word));
  if (values.size() != count) fail(key, "does not hold " + std::to_string(count) + " numbers");
  return values;
}

std::string stamps_text(const std::map<PatchIndex, std::int64_t>& stamps) {
  std::string text;
  for (const auto& [patch, stamp] : stamps) {
    text += (text.empty() ? "" : ";") + std::to_string(patch.x) + " " + std::to_string(patch.y) + " " +
            std::to_string(stamp);
  }
  return text;
}

std::map<PatchIndex, std::int64_t> stamps_from(const std::string& text) {
  const std::string key = "STAMPS_NS";
  std::map<PatchIndex, std::int64_t> stamps;
  for (const std::string& entry : split(text, ';')) {
    const auto words = split(entry, ' ');
    if (words.size() != 3) fail(key, "is no list of 'ix iy stamp'");
    const std::int64_t x = whole(key, words[0]), y = whole(key, words[1]);
    if (x != static_cast<std::int32_t>(x) || y != static_cast<std::int32_t>(y)) fail(key, "names no patch");
    stamps[{static_cast<std::int32_t>(x), static_cast<std::int32_t>(y)}] = whole(key, words[2]);
  }
  return stamps;
}

LayerType type_from(const Items& items) {
  LayerType type;
  type.name = need(items, "LAYER");
  // Real channels have none.
  if (items.contains("HYPOTHESES")) type.hypotheses = split(items.at("HYPOTHESES"), ' ');
  type.channels = split(need(items, "CHANNELS"), ' ');
  const auto policy = policy_from(need(items, "POLICY"));
  if (!policy) fail("POLICY", "names no policy");
  type.policy = *policy;
  if (items.contains("SLAB_UM")) {
    const auto slab = wholes(items, "SLAB_UM", 2);
    type.slab = Slab{slab[0], slab[1]};
  }
  return type;
}

Frame frame_from(const Items& items) {
  Frame frame;
  frame.frame_id = need(items, "FRAME_ID");
  frame.edge_um = wholes(items, "EDGE_UM", 1)[0];
  const auto datum = wholes(items, "DATUM_UM", 2);
  frame.datum_x_um = datum[0];
  frame.datum_y_um = datum[1];
  const std::int64_t epsg = wholes(items, "EPSG", 1)[0];
  if (epsg != 0) frame.epsg = static_cast<std::int32_t>(epsg);
  if (epsg < 0 || epsg > 999'999) fail("EPSG", "is no EPSG code");
  return frame;
}

}  // namespace

Items to_items(const MapTags& tags) {
  Items items{
      {"VERSION", std::string(kVersion)},
      {"CELLS", tags.classes ? "classes" : "masses"},
      {"LAYER", tags.type.name},
      {"HYPOTHESES", join(tags.type.hypotheses)},
      {"CHANNELS", join(tags.type.channels)},
      {"POLICY", std::string(to_string(tags.type.policy))},
      {"FRAME_ID", tags.frame.frame_id},
      {"EPSG", std::to_string(tags.frame.epsg.value_or(0))},
      {"EDGE_UM", std::to_string(tags.frame.edge_um)},
      {"DATUM_UM", std::to_string(tags.frame.datum_x_um) + " " + std::to_string(tags.frame.datum_y_um)},
      {"STEP", std::to_string(tags.step)}};
  if (tags.type.is_evidence()) items["HYPOTHESES"] = join(tags.type.hypotheses);
  if (tags.type.slab) {
    items["SLAB_UM"] =
        std::to_string(tags.type.slab->z_min_um) + " " + std::to_string(tags.type.slab->z_max_um);
  }
  if (tags.stamp_ns != 0) items["STAMP_NS"] = std::to_string(tags.stamp_ns);
  if (tags.class_mass) items["CLASS_MASS"] = format_number(*tags.class_mass);
  if (!tags.stamps_ns.empty()) items["STAMPS_NS"] = stamps_text(tags.stamps_ns);
  return items;
}

std::optional<MapTags> from_items(const Items& items) {
  if (items.empty()) return {};
  if (need(items, "VERSION") != kVersion) {
    throw Error(ErrorCode::kUnsupported, "metadata domain 'APGM' has version " +
                                             printable(items.at("VERSION")) + ", this reader knows 1");
  }
  MapTags tags;
  const std::string& cells = need(items, "CELLS");
  if (cells != "masses" && cells != "classes") fail("CELLS", "is neither masses nor classes");
  tags.classes = cells == "classes";
  try {
    tags.type = type_from(items);
    tags.type.check();
    tags.frame = frame_from(items);
    tags.frame.check();
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kDamaged) throw;
    throw Error(ErrorCode::kDamaged, "metadata domain 'APGM': " + error.message()).hint(error.hint());
  }
  if (tags.classes && !tags.type.is_evidence()) fail("HYPOTHESES", "names no classes");
  const std::int64_t step = wholes(items, "STEP", 1)[0];
  if (step < 0 || step > kMaxStep) fail("STEP", "does not lie in 0..11");
  tags.step = static_cast<int>(step);
  if (items.contains("STAMP_NS")) tags.stamp_ns = wholes(items, "STAMP_NS", 1)[0];
  if (items.contains("CLASS_MASS")) {
    tags.class_mass = parse_number(items.at("CLASS_MASS"));
    if (!tags.class_mass || *tags.class_mass < 1e-6 || *tags.class_mass > 1) {
      fail("CLASS_MASS", "is no mass");
    }
  }
  if (items.contains("STAMPS_NS")) tags.stamps_ns = stamps_from(items.at("STAMPS_NS"));
  return tags;
}

}  // namespace apgm::converters

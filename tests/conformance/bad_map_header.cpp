// MapHeader: the FlatBuffer itself, then what it says.

#include <cstring>

#include "bad_files.hpp"
#include "small_map.hpp"

namespace apgm::test {
namespace {

std::string with_header(const std::string& flat) {
  Parts parts = small_map();
  parts.map_header = flat;
  return put_together(parts);
}

std::string with_raw(const std::function<void(RawHeader&)>& change) {
  Parts parts = small_map();
  RawHeader header = raw(parts.header);
  change(header);
  parts.map_header = map_header_flat(header);
  Frame& f = parts.header.frame;  // the content id fits what is stored
  f.edge_um = header.edge_um;
  f.datum_x_um = header.datum_x_um;
  f.datum_y_um = header.datum_y_um;
  f.epsg = header.epsg;
  f.frame_id = header.frame_id;
  return put_together(parts);
}

/// A map without layers, so that types may be anything.
std::string with_type(const std::function<void(RawType&)>& change) {
  RawHeader header;
  change(header.types[0]);
  Parts parts;
  parts.header.types = TypeTable({LayerType::occupancy()});
  parts.map_header = map_header_flat(header);
  return put_together(parts);
}

template <typename T>
T at(const std::string& bytes, std::size_t place) {
  T value;
  std::memcpy(&value, bytes.data() + place, sizeof(T));
  return value;
}

template <typename T>
void set(std::string& bytes, std::size_t place, T value) {
  std::memcpy(bytes.data() + place, &value, sizeof(T));
}

std::size_t root_of(const std::string& flat) { return at<std::uint32_t>(flat, 0); }

std::size_t vtable_of(const std::string& flat) {
  const std::size_t table = root_of(flat);
  return static_cast<std::size_t>(static_cast<std::int64_t>(table) - at<std::int32_t>(flat, table));
}

/// Place of a field of the root table.
std::size_t field_of(const std::string& flat, std::size_t id) {
  return root_of(flat) + at<std::uint16_t>(flat, vtable_of(flat) + 4 + 2 * id);
}

constexpr std::size_t kFrameId = 4, kTypes = 5;

void add_flatbuffers(BadFiles& out) {
  const std::string rule = "3: the FlatBuffer is well formed";
  const auto add = [&](const std::string& name, const std::function<void(std::string&)>& change) {
    std::string flat = map_header_flat(raw(small_map().header));
    change(flat);
    out.add("flatbuffer_" + name, "damaged", rule, with_header(flat));
  };
  add("root_outside", [](auto& f) { set<std::uint32_t>(f, 0, static_cast<std::uint32_t>(f.size())); });
  add("root_not_aligned",
      [](auto& f) { set<std::uint32_t>(f, 0, static_cast<std::uint32_t>(root_of(f)) + 2); });
  add("vtable_outside", [](auto& f) { set<std::int32_t>(f, root_of(f), 1 << 20); });
  add("vtable_behind", [](auto& f) { set<std::int32_t>(f, root_of(f), -(1 << 20)); });
  add("vtable_size_odd", [](auto& f) {
    const std::size_t v = vtable_of(f);
    set<std::uint16_t>(f, v, static_cast<std::uint16_t>(at<std::uint16_t>(f, v) - 1));
  });
  add("vtable_size_huge", [](auto& f) { set<std::uint16_t>(f, vtable_of(f), 0xfffe); });
  add("field_outside", [](auto& f) { set<std::uint16_t>(f, vtable_of(f) + 4, 0xfff8); });
  add("required_missing", [](auto& f) { set<std::uint16_t>(f, vtable_of(f) + 4 + 2 * kFrameId, 0); });
  add("offset_0", [](auto& f) { set<std::uint32_t>(f, field_of(f, kTypes), 0); });
  add("string_outside", [](auto& f) { set<std::uint32_t>(f, field_of(f, kFrameId), 1 << 20); });
  add("string_too_long", [](auto& f) {
    const std::size_t place = field_of(f, kFrameId);
    set<std::uint32_t>(f, place + at<std::uint32_t>(f, place), 0x7fffffff);
  });
  add("string_without_end", [](auto& f) {
    const std::size_t place = field_of(f, kFrameId);
    const std::size_t start = place + at<std::uint32_t>(f, place);
    f[start + 4 + at<std::uint32_t>(f, start)] = 'x';
  });
  add("vector_too_long", [](auto& f) {
    const std::size_t place = field_of(f, kTypes);
    set<std::uint32_t>(f, place + at<std::uint32_t>(f, place), 0x3fffffff);
  });
  add("table_outside", [](auto& f) {
    const std::size_t place = field_of(f, kTypes);
    set<std::uint32_t>(f, place + at<std::uint32_t>(f, place) + 4, 1 << 20);
  });
  out.add("flatbuffer_missing", "damaged", rule, with_header(std::string(8, '\0')));
}

void add_frames(BadFiles& out) {
  const auto add = [&](const std::string& name, const std::string& rule,
                       const std::function<void(RawHeader&)>& change) {
    out.add("header_" + name, "damaged", "3: " + rule, with_raw(change));
  };
  add("edge_too_small", "edge", [](RawHeader& h) { h.edge_um = 999; });
  add("edge_too_large", "edge", [](RawHeader& h) { h.edge_um = 10'000'000'001; });
  add("edge_negative", "edge", [](RawHeader& h) { h.edge_um = -12'800'000; });
  add("datum_x_too_large", "datum", [](RawHeader& h) { h.datum_x_um = 1'000'000'000'000'001; });
  add("datum_y_too_small", "datum", [](RawHeader& h) { h.datum_y_um = -1'000'000'000'000'001; });
  add("datum_least_int64", "datum", [](RawHeader& h) { h.datum_x_um = INT64_MIN; });
  add("epsg_negative", "EPSG", [](RawHeader& h) { h.epsg = -1; });
  add("epsg_too_large", "EPSG", [](RawHeader& h) { h.epsg = 1'000'000; });
  add("frame_id_empty", "frame id", [](RawHeader& h) { h.frame_id.clear(); });
  add("frame_id_too_long", "frame id", [](RawHeader& h) { h.frame_id.assign(256, 'm'); });
  add("frame_id_with_control", "frame id", [](RawHeader& h) { h.frame_id = "a\nb"; });
  add("frame_id_not_utf8", "frame id", [](RawHeader& h) { h.frame_id = "\xff"; });
  add("frame_id_with_nul", "frame id", [](RawHeader& h) { h.frame_id = std::string("a\0b", 3); });
}

void add_lists(BadFiles& out) {
  const auto add = [&](const std::string& name, const std::string& rule,
                       const std::function<void(RawHeader&)>& change) {
    out.add("header_" + name, "damaged", "3: " + rule, with_raw(change));
  };
  add("metadata_not_ascending", "metadata ascend by key", [](RawHeader& h) {
    h.metadata = {{"b", "1"}, {"a", "2"}};
  });
  add("metadata_key_twice", "metadata ascend by key", [](RawHeader& h) {
    h.metadata = {{"a", "1"}, {"a", "1"}};
  });
  add("metadata_key_empty", "keys are not empty", [](RawHeader& h) { h.metadata = {{"", "1"}}; });
  add("metadata_key_with_control", "keys hold no control characters", [](RawHeader& h) {
    h.metadata = {{"a\tb", "1"}};
  });
  add("metadata_value_not_utf8", "texts are UTF-8", [](RawHeader& h) { h.metadata = {{"a", "\xc3\x28"}}; });
  add("metadata_overlong_utf8", "texts are UTF-8", [](RawHeader& h) { h.metadata = {{"a", "\xc0\xaf"}}; });
  add("metadata_surrogate", "texts are UTF-8", [](RawHeader& h) { h.metadata = {{"a", "\xed\xa0\x80"}}; });
  add("metadata_value_with_nul", "texts hold no NUL", [](RawHeader& h) {
    h.metadata = {{"a", std::string("\0", 1)}};
  });
  add("metadata_1025", "1024 metadata pairs", [](RawHeader& h) {
    for (int i = 0; i < 1025; ++i) h.metadata.emplace_back(std::to_string(10'000 + i), "");
  });
  add("history_operation_with_control", "operations hold no control characters", [](RawHeader& h) {
    h.history = {{"a\nb", "", ""}};
  });
  add("history_inputs_two_spaces", "lists are joined by single spaces", [](RawHeader& h) {
    h.history = {{"merge", "a  b", "{}"}};
  });
  add("history_inputs_leading_space", "lists are joined by single spaces", [](RawHeader& h) {
    h.history = {{"merge", " a", "{}"}};
  });
  add("history_inputs_trailing_space", "lists are joined by single spaces", [](RawHeader& h) {
    h.history = {{"merge", "a ", "{}"}};
  });
  add("types_not_ascending", "types ascend by name", [](RawHeader& h) { std::swap(h.types[0], h.types[1]); });
  add("types_same_name", "types ascend by name", [](RawHeader& h) { h.types[1].name = h.types[0].name; });
  add("type_missing", "5: totals of each layer type", [](RawHeader& h) { h.types.pop_back(); });
}

void add_types(BadFiles& out) {
  const auto add = [&](const std::string& name, const std::string& rule,
                       const std::function<void(RawType&)>& change) {
    out.add("type_" + name, "damaged", "3: " + rule, with_type(change));
  };
  add("name_empty", "names", [](RawType& t) { t.name.clear(); });
  add("name_of_65_bytes", "names", [](RawType& t) { t.name.assign(65, 'n'); });
  add("name_with_sign_first", "names", [](RawType& t) { t.name = "-n"; });
  add("name_with_slash", "names", [](RawType& t) { t.name = "a/b"; });
  add("name_not_ascii", "names", [](RawType& t) { t.name = "\xc3\xa9"; });
  add("one_hypothesis", "none or 2 to 15 hypotheses", [](RawType& t) {
    t.hypotheses = "O";
    t.channels = "O Omega";
    t.policy = "mean";
  });
  add("sixteen_hypotheses", "none or 2 to 15 hypotheses", [](RawType& t) {
    t.hypotheses = t.channels = "a b c d e f g h i j k l m n o p";
    t.policy = "mean";
  });
  add("no_channels", "1 to 16 channels", [](RawType& t) {
    t.hypotheses = t.channels = "";
    t.policy = "mean";
  });
  add("seventeen_channels", "1 to 16 channels", [](RawType& t) {
    t.hypotheses = "";
    t.channels = "a b c d e f g h i j k l m n o p q";
    t.policy = "mean";
  });
  add("channels_too_few", "1: a channel a hypothesis, and perhaps one more", [](RawType& t) {
    t.channels = "O";
    t.policy = "mean";
  });
  add("channels_too_many", "1: a channel a hypothesis, and perhaps one more", [](RawType& t) {
    t.channels = "O F Omega more";
    t.policy = "mean";
  });
  add("channels_two_spaces", "lists are joined by single spaces", [](RawType& t) { t.channels = "O  F"; });
  add("policy_for_occupancy", "policies", [](RawType& t) { t.channels = "O F Omega"; });
  add("policy_for_omega", "policies", [](RawType& t) { t.policy = "evidence"; });
  add("policy_for_real", "policies", [](RawType& t) { t.policy = "sum"; });
  add("slab_empty", "slab", [](RawType& t) {
    t.has_slab = true;
    t.z_min_um = t.z_max_um = 5;
  });
  add("slab_too_low", "slab", [](RawType& t) {
    t.has_slab = true;
    t.z_min_um = -1'000'000'000'001;
  });
  add("slab_too_high", "slab", [](RawType& t) {
    t.has_slab = true;
    t.z_max_um = 1'000'000'000'001;
  });
  out.add("type_policy_unknown", "unsupported", "3: policies",
          with_type([](RawType& t) { t.policy = "voting"; }));
}

/// A history that is one entry, named again and again: little in the file, much in memory.
std::string with_history(std::size_t entries, std::size_t parameter_bytes) {
  flatbuffers::FlatBufferBuilder fb;
  const auto operation = fb.CreateString("merge");
  const auto parameters = fb.CreateString(std::string(parameter_bytes, 'p'));
  const auto entry = fbs::CreateProvenance(fb, operation, 0, parameters);
  const auto frame_id = fb.CreateString("map");
  const auto history = fb.CreateVector(std::vector(entries, entry));
  fb.Finish(fbs::CreateMapHeader(fb, 12'800'000, 0, 0, 0, frame_id, 0, 0, history));
  Parts parts;
  parts.map_header.assign(reinterpret_cast<const char*>(fb.GetBufferPointer()), fb.GetSize());
  parts.map_header.resize((parts.map_header.size() + 7) / 8 * 8);
  return put_together(parts);
}

}  // namespace

void add_map_headers(BadFiles& out) {
  add_flatbuffers(out);
  add_frames(out);
  add_lists(out);
  add_types(out);
  out.add("header_history_1025", "damaged", "3: 1024 history entries", with_history(1025, 2));
  out.add("header_texts_of_17_mib", "damaged", "3: all texts take at most 16 MiB",
          with_history(1024, 17 * 1024));
  out.add("header_with_body", "damaged", "3: a MapHeader has no body", [] {
    Hooks hooks;
    hooks.payload = [](BlockHead& head, std::string& payload) {
      if (head.kind == kMapHeader) payload.append(8, '\0');
    };
    return put_together(small_map(), hooks);
  }());
}

}  // namespace apgm::test

#include "map_header.hpp"

#include <algorithm>

#include "apgm/core/error.hpp"
#include "apgm/core/text.hpp"
#include "apgm_generated.h"

namespace apgm::format {
namespace {

using flatbuffers::FlatBufferBuilder;

[[noreturn]] void fail(const char* what) { throw Error(ErrorCode::kDamaged, what); }

std::string join(const std::vector<std::string>& names) {
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "" : " ") + name;
  return text;
}

std::vector<std::string> split(std::string_view text, std::size_t most) {
  std::vector<std::string> names;
  while (!text.empty()) {
    const auto end = text.find(' ');
    names.emplace_back(text.substr(0, end));
    text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 1);
    const bool ends_in_space = end != std::string_view::npos && text.empty();
    if (names.back().empty() || ends_in_space || names.size() > most)
      fail("a list in the map header is malformed");
  }
  return names;
}

/// Bytes copied out of a header in all: strings may share their place, so the size of the buffer bounds
/// nothing.
class Budget {
 public:
  /// Free text: UTF-8 without NUL.
  std::string_view take(const flatbuffers::String* text) {
    if (text == nullptr) return {};
    if (text->size() > left_) fail("the map header's strings are larger than the map header");
    left_ -= text->size();
    const std::string_view view(text->c_str(), text->size());
    if (!is_utf8(view)) fail("a text in the map header is not UTF-8");
    return view;
  }

 private:
  std::uint64_t left_ = kMaxHeaderBytes;
};

flatbuffers::Offset<fbs::LayerType> build(FlatBufferBuilder& fb, const LayerType& type) {
  const auto name = fb.CreateString(type.name);
  const auto hypotheses = type.is_evidence() ? fb.CreateString(join(type.hypotheses)) : 0;
  const auto channels = fb.CreateString(join(type.channels));
  const auto policy = fb.CreateString(std::string(to_string(type.policy)));
  return fbs::CreateLayerType(fb, name, hypotheses, channels, policy, type.slab.has_value(),
                              type.slab ? type.slab->z_min_um : 0, type.slab ? type.slab->z_max_um : 0);
}

LayerType read_type(const fbs::LayerType& stored, Budget& budget) {
  LayerType type;
  type.name = budget.take(stored.name());
  type.hypotheses = split(budget.take(stored.hypotheses()), 16);
  type.channels = split(budget.take(stored.channels()), 16);
  const auto policy = policy_from(budget.take(stored.policy()));
  if (!policy) {
    throw Error(ErrorCode::kUnsupported, "layer type '" + type.name + "' has an unknown resampling policy")
        .hint("a newer version of apgm can read it");
  }
  type.policy = *policy;
  if (stored.has_slab()) type.slab = Slab{stored.z_min_um(), stored.z_max_um()};
  return type;
}

template <typename Vector>
std::size_t size_of(const Vector* v) {
  return v == nullptr ? 0 : v->size();
}

/// Strictly ascending names or keys, so that one map has one header.
template <typename T, typename Name>
void check_ascending(const T& list, Name name) {
  for (std::size_t i = 1; i < list.size(); ++i) {
    if (name(list[i - 1]) >= name(list[i])) fail("the map header's lists are not in order");
  }
}

}  // namespace

namespace {

[[noreturn]] void refuse(const std::string& what) { throw Error(ErrorCode::kInvalidArgument, what); }

/// What a header may hold is what a reader gives back unchanged.
void check_texts(const MapHeader& header) {
  for (const auto& [key, value] : header.metadata) {
    if (key.empty() || !is_plain_text(key) || !is_utf8(value)) refuse("a metadata pair is not UTF-8 text");
  }
  for (const Provenance& p : header.history) {
    if (!is_plain_text(p.operation) || !is_utf8(p.parameters)) refuse("a history entry is not UTF-8 text");
    if (p.inputs.size() > kMaxInputs)
      throw Error(ErrorCode::kLimit, "a history entry names more than 65536 inputs");
    for (const std::string& input : p.inputs) {
      if (input.empty() || !is_plain_text(input) || input.find(' ') != std::string::npos) {
        refuse("an input in the history is empty or holds a space");
      }
    }
  }
}

}  // namespace

BlockHeader append_map_header(std::vector<std::byte>& out, const MapHeader& header, std::uint64_t commit) {
  header.frame.check();
  if (header.metadata.size() > kMaxMetadata || header.history.size() > kMaxHistory) {
    throw Error(ErrorCode::kLimit, "a map holds at most 1024 metadata pairs and 1024 history entries");
  }
  check_texts(header);
  FlatBufferBuilder fb(4096);
  std::vector<flatbuffers::Offset<fbs::LayerType>> types;
  for (const LayerType& type : header.types) types.push_back(build(fb, type));
  std::vector<flatbuffers::Offset<fbs::KeyValue>> metadata;
  for (const auto& [key, value] : header.metadata) {
    metadata.push_back(fbs::CreateKeyValueDirect(fb, key.c_str(), value.c_str()));
  }
  std::vector<flatbuffers::Offset<fbs::Provenance>> history;
  for (const Provenance& p : header.history) {
    history.push_back(
        fbs::CreateProvenanceDirect(fb, p.operation.c_str(), join(p.inputs).c_str(), p.parameters.c_str()));
  }
  const auto frame_id = fb.CreateString(header.frame.frame_id);
  const auto types_at = fb.CreateVector(types);
  const auto metadata_at = fb.CreateVector(metadata);
  const auto history_at = fb.CreateVector(history);
  const Frame& f = header.frame;
  fb.Finish(fbs::CreateMapHeader(fb, f.edge_um, f.datum_x_um, f.datum_y_um, f.epsg.value_or(0), frame_id,
                                 types_at, metadata_at, history_at, header.stamp_ns));
  if (fb.GetSize() > kMaxHeaderBytes) throw Error(ErrorCode::kLimit, "the map header exceeds 16 MiB");
  return append_block(out, Kind::kMapHeader, 0, std::as_bytes(std::span(fb.GetBufferPointer(), fb.GetSize())),
                      {}, commit);
}

MapHeader read_map_header(Bytes bytes) { return read_map_header(parse_block(bytes, Kind::kMapHeader)); }

MapHeader read_map_header(const Block& block) {
  if (!block.body.empty() || block.meta.size() > kMaxHeaderBytes) fail("the map header is malformed");
  constexpr auto kMaxTables =
      static_cast<flatbuffers::uoffset_t>(TypeTable::kMaxTypes + kMaxMetadata + kMaxHistory + 1);
  // A block that came down a wire may lie at any address.
  const std::vector<std::byte> meta(block.meta.begin(), block.meta.end());
  flatbuffers::Verifier verifier(reinterpret_cast<const std::uint8_t*>(meta.data()), meta.size(), 8,
                                 kMaxTables);
  if (!verifier.VerifyBuffer<fbs::MapHeader>(nullptr)) fail("the map header is malformed");
  const auto& stored = *flatbuffers::GetRoot<fbs::MapHeader>(meta.data());
  if (size_of(stored.types()) > TypeTable::kMaxTypes || size_of(stored.metadata()) > kMaxMetadata ||
      size_of(stored.history()) > kMaxHistory) {
    fail("the map header's lists are too long");
  }
  Budget budget;
  MapHeader header;
  header.frame.edge_um = stored.edge_um();
  header.frame.datum_x_um = stored.datum_x_um();
  header.frame.datum_y_um = stored.datum_y_um();
  if (stored.epsg() != 0) header.frame.epsg = stored.epsg();
  header.frame.frame_id = budget.take(stored.frame_id());
  header.stamp_ns = stored.stamp_ns();
  std::vector<LayerType> types;
  for (std::size_t i = 0; i < size_of(stored.types()); ++i) {
    types.push_back(read_type(*stored.types()->Get(static_cast<flatbuffers::uoffset_t>(i)), budget));
  }
  check_ascending(types, [](const LayerType& t) { return t.name; });
  std::vector<std::pair<std::string, std::string>> metadata;
  for (std::size_t i = 0; i < size_of(stored.metadata()); ++i) {
    const auto* pair = stored.metadata()->Get(static_cast<flatbuffers::uoffset_t>(i));
    metadata.emplace_back(budget.take(pair->key()), budget.take(pair->value()));
  }
  check_ascending(metadata, [](const auto& pair) { return pair.first; });
  header.metadata.insert(metadata.begin(), metadata.end());
  for (std::size_t i = 0; i < size_of(stored.history()); ++i) {
    const auto* p = stored.history()->Get(static_cast<flatbuffers::uoffset_t>(i));
    header.history.push_back({std::string(budget.take(p->operation())),
                              split(budget.take(p->inputs()), kMaxInputs),
                              std::string(budget.take(p->parameters()))});
  }
  try {
    header.frame.check();
    header.types = TypeTable(std::move(types));
    check_texts(header);
  } catch (const Error& e) {
    throw Error(ErrorCode::kDamaged, "the map header cannot be used: " + e.message());
  }
  return header;
}

}  // namespace apgm::format

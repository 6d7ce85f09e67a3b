#include "stream_messages.hpp"

#include <algorithm>

#include "apgm/core/error.hpp"
#include "codec.hpp"
#include "content_id.hpp"
#include "map_header.hpp"

namespace apgm::format {
namespace {

[[noreturn]] void fail(const char* what) { throw Error(ErrorCode::kDamaged, what); }

/// Of all blocks but layers and parts.
void check_no_key(const Block& block) {
  if (block.header.key != 0) fail("a block that is of no patch has a key");
}

std::pair<std::uint64_t, TypeId> place(const GoneRecord& r) { return {curve_key({r.ix, r.iy}), r.type}; }

}  // namespace

std::shared_ptr<const StreamHeader> read_stream_header(const Block& block) {
  check_no_key(block);
  if (block.header.context != block.header.payload_hash) fail("a map header is not under its own hash");
  auto read = std::make_shared<StreamHeader>();
  read->header = read_map_header(block);
  read->hash = block.header.payload_hash;
  read->bytes = block.header.payload_bytes;
  for (const LayerType& type : read->header.types)
    read->names.push_back(hash_of(std::as_bytes(std::span(type.name))));
  return read;
}

LayerBlock read_stream_layer(const Block& block, const TypeTable& types) {
  LayerBlock layer = read_layer_block(block);
  LayerInfo& info = layer.info;
  if (info.step > kMaxStep || info.type >= types.size())
    fail("a layer is of a step or type that does not exist");
  const LayerType& type = types[info.type];
  const std::uint64_t bytes = sizeof(BlockHeader) + padded(block.header.payload_bytes);
  if (value_bytes(type, info.step) > Layer::kMaxBytes) fail("a layer is of more than 64 MiB");
  if (bytes > most_stored_bytes(type, info.step)) fail("a layer's block is too large for its values");
  if (info.encoding > kLastEncoding) {
    throw Error(ErrorCode::kUnsupported, "a layer is stored in encoding " + std::to_string(info.encoding));
  }
  info.stored_bytes = static_cast<std::uint32_t>(bytes);
  return layer;
}

std::vector<GoneRecord> read_gone(const Block& block, const TypeTable& types) {
  check_no_key(block);
  const std::size_t count = block.body.size() / sizeof(GoneRecord);
  if (!block.meta.empty() || count == 0 || count > kMaxGoneRecords ||
      block.body.size() % sizeof(GoneRecord) != 0) {
    fail("a list of what is gone is malformed");
  }
  std::vector<GoneRecord> records;
  for (std::size_t i = 0; i < count; ++i) {
    const auto r = read_as<GoneRecord>(block.body.subspan(i * sizeof(GoneRecord)));
    if (r.type >= types.size() || std::ranges::any_of(r.reserved, [](auto v) { return v != 0; }) ||
        (i > 0 && place(records.back()) >= place(r))) {
      fail("a list of what is gone is malformed");
    }
    records.push_back(r);
  }
  return records;
}

EndBody read_end(const Block& block) {
  check_no_key(block);
  if (!block.meta.empty() || block.body.size() != sizeof(EndBody)) fail("the end of a message is malformed");
  const auto end = read_as<EndBody>(block.body);
  const std::uint64_t commit = block.header.commit;
  if (end.flags > kWholeMap || end.first > commit || session_of(end.first) != session_of(commit) ||
      number_of(end.first) == 0) {
    fail("the end of a message is malformed");
  }
  return end;
}

void check_other(const Block& block) {
  if (block.header.kind >= Kind::kMapHeader && block.header.kind <= Kind::kEnd) {
    fail("a block of a file in a stream");
  }
  if (block.header.flags != 0) {
    throw Error(ErrorCode::kUnsupported, "a block of an unknown kind that must be understood");
  }
  check_no_key(block);
}

std::string id_text(const std::array<std::byte, 16>& id) {
  return id == std::array<std::byte, 16>{} ? std::string{} : to_hex(id);
}

std::array<std::byte, 16> id_from_text(const std::string& text) {
  std::array<std::byte, 16> id{};
  if (text.empty()) return id;
  const auto digit = [&](std::size_t i) {
    const std::size_t value = std::string_view("0123456789abcdef").find(text[i]);
    if (value == std::string_view::npos) {
      throw Error(ErrorCode::kInvalidArgument, "'" + text + "' is no content id");
    }
    return static_cast<unsigned>(value);
  };
  if (text.size() != 2 * id.size())
    throw Error(ErrorCode::kInvalidArgument, "'" + text + "' is no content id");
  for (std::size_t i = 0; i < id.size(); ++i) id[i] = std::byte(digit(2 * i) << 4 | digit(2 * i + 1));
  return id;
}

std::uint64_t place_hash(PatchIndex patch, std::uint64_t name) {
  const std::array<std::uint64_t, 2> values{curve_key(patch), name};
  return hash_of(bytes_of(values));
}

}  // namespace apgm::format

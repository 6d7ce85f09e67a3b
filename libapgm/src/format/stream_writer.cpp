#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/format/stream.hpp"
#include "content_id.hpp"
#include "layer_block.hpp"
#include "map_header.hpp"
#include "stream_messages.hpp"

namespace apgm {

using namespace format;

namespace {

constexpr std::uint64_t kMostBlocks = std::numeric_limits<std::uint32_t>::max();
/// A repeated header takes at most this part of a stream.
constexpr std::uint64_t kHeaderShare = 16;
constexpr std::size_t kPartOverhead = sizeof(BlockHeader) + sizeof(PartHead);

void check(const StreamOptions& options) {
  check_level(options.level);
  if (options.mtu_bytes != 0 && options.mtu_bytes < StreamOptions::kLeastMtu) {
    throw Error(ErrorCode::kInvalidArgument,
                "blocks of " + std::to_string(options.mtu_bytes) + " bytes are too small for a stream")
        .hint("allow 256 bytes or more");
  }
}

/// The map header's block as it is sent, but for its number.
std::vector<std::byte> header_block(const MapHeader& header) {
  std::vector<std::byte> block;
  append_map_header(block, header);
  return block;
}

}  // namespace

struct StreamWriter::State {
  State(Output send, const MapHeader& map_header, const StreamOptions& stream_options)
      : output(std::move(send)), options(stream_options) {
    set_header(map_header);
  }

  Output output;
  StreamOptions options;
  MapHeader header;
  std::vector<std::byte> header_bytes;
  std::uint64_t context = 0;  // payload hash of the header's block
  StreamWritten written;
  std::uint64_t number = 0;        // of the last block
  std::uint64_t since_header = 0;  // bytes
  std::vector<std::byte> block;
  std::vector<std::byte> part;

  struct Message {
    explicit Message(const MapHeader& header) : id(header) {}
    ContentId id;
    std::uint64_t first = 0;
    std::uint64_t layers = 0;
    std::uint64_t gone = 0;
    std::optional<std::pair<std::uint64_t, TypeId>> last;
    bool in_order = true;
  };
  std::optional<Message> message;

  void set_header(const MapHeader& map_header) {
    header_bytes = header_block(map_header);
    header = map_header;
    context = read_as<BlockHeader>(header_bytes).payload_hash;
  }

  void emit(Bytes bytes) {
    written.bytes += bytes.size();
    since_header += bytes.size();
    output(bytes);
  }

  std::uint64_t next_commit(std::uint64_t blocks) {
    if (blocks > kMostBlocks - number) {
      throw Error(ErrorCode::kLimit, "a stream holds at most 2^32 blocks").hint("begin another session");
    }
    number += blocks;
    written.blocks += blocks;
    return stream_commit(options.session, number);
  }

  /// Sends a whole block under the next number, in parts if it is too large.
  void send(std::span<std::byte> whole) {
    if (options.mtu_bytes != 0 && whole.size() > options.mtu_bytes) return send_parts(whole);
    restamp(whole, next_commit(1), context);
    emit(whole);
  }

  /// The whole has the number of its last part: all that was sent before is older than it.
  void send_parts(std::span<std::byte> whole) {
    const std::size_t share = (options.mtu_bytes - kPartOverhead) / 8 * 8;
    const std::size_t count = (whole.size() + share - 1) / share;
    const std::uint64_t last = next_commit(count);
    restamp(whole, last, context);
    const std::uint64_t key = read_as<BlockHeader>(whole).key;
    std::vector<std::byte> body;
    for (std::size_t i = 0; i < count; ++i) {
      const Bytes piece = whole.subspan(i * share, std::min(share, whole.size() - i * share));
      const PartHead head{static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(count), whole.size()};
      const Bytes head_bytes = bytes_of(head);
      body.assign(head_bytes.begin(), head_bytes.end());
      body.insert(body.end(), piece.begin(), piece.end());
      part.clear();
      append_block(part, Kind::kPart, key, {}, body, last - (count - 1 - i), context);
      emit(part);
    }
  }

  void send_header() {
    send(header_bytes);
    since_header = 0;
  }

  Message& open() {
    if (!message) {
      if (number == 0) send_preamble();
      message.emplace(header);
      message->first = stream_commit(options.session, number + 1);
      send_header();
    }
    return *message;
  }

  void send_preamble() {
    Preamble preamble;
    preamble.incompat = kStreamBit;
    preamble.hash = hash_of(bytes_of(preamble).first(offsetof(Preamble, hash)));
    emit(bytes_of(preamble));
  }

  /// Before a block that needs the header.
  Message& ready() {
    Message& m = open();
    if (options.header_every_bytes != 0 && since_header >= options.header_every_bytes &&
        since_header >= kHeaderShare * header_bytes.size()) {
      send_header();
    }
    return m;
  }

  void put_layer(const Parcel& parcel) {
    Message& m = ready();
    const std::pair<std::uint64_t, TypeId> place{curve_key(parcel.patch), parcel.type};
    if (m.last && place <= *m.last) m.in_order = false;
    m.last = place;
    m.id.add(parcel.patch, parcel.type, parcel.stored.step, parcel.stored.content_hash);
    ++m.layers;
    ++written.layers;
    block.clear();
    append_layer(block, parcel);
    send(block);
  }

  void put_gone(std::span<const GoneRecord> records) {
    Message& m = ready();
    m.gone += records.size();
    written.gone += records.size();
    block.clear();
    append_block(block, Kind::kGone, 0, {}, std::as_bytes(records));
    send(block);
  }

  std::size_t records_a_block() const {
    if (options.mtu_bytes == 0) return kMaxGoneRecords;
    return std::min((options.mtu_bytes - sizeof(BlockHeader)) / sizeof(GoneRecord), kMaxGoneRecords);
  }

  void end(EndBody body) {
    const Message& m = ready();
    body.layers = m.layers;
    body.gone = m.gone;
    body.first = m.first;
    block.clear();
    append_block(block, Kind::kEnd, 0, {}, bytes_of(body));
    send(block);
    ++written.messages;
    written.content_id = id_text(body.result);
    message.reset();
  }
};

StreamWriter::StreamWriter(Output output, const MapHeader& header, const StreamOptions& options) {
  check(options);
  state_ = std::make_unique<State>(std::move(output), header, options);
}

StreamWriter::~StreamWriter() = default;

bool StreamWriter::takes_stored() const { return state_->options.lossy == Lossy::kNone; }

void StreamWriter::pack(Parcel& parcel) const {
  pack_layer(parcel, state_->header.types[parcel.type], state_->options.level, state_->options.lossy);
}

std::uint64_t StreamWriter::working_bytes(std::uint64_t layer_bytes) const {
  return pack_memory(layer_bytes, state_->options.level);
}

void StreamWriter::put(PatchIndex /*index*/, std::span<Parcel> parcels) {
  for (const Parcel& parcel : parcels) {
    if (parcel.state == Parcel::State::kStored) state_->put_layer(parcel);
  }
}

void StreamWriter::gone(std::span<const MapChanges::Gone> gone) {
  std::vector<GoneRecord> records;
  for (const MapChanges::Gone& g : gone) {
    const auto type = state_->header.types.find(g.layer);
    if (!type) {
      throw Error(ErrorCode::kInvalidArgument,
                  "layer '" + g.layer + "', which is gone, is of no type of the stream");
    }
    records.push_back({g.patch.x, g.patch.y, *type, {}});
  }
  const std::size_t most = state_->records_a_block();
  for (std::span<const GoneRecord> rest = records; !rest.empty();) {
    const std::size_t count = std::min(rest.size(), most);
    state_->put_gone(rest.first(count));
    rest = rest.subspan(count);
  }
}

void StreamWriter::end(const MessageEnd& ids) {
  EndBody body;
  body.base = id_from_text(ids.base);
  body.result = id_from_text(ids.result);
  state_->end(body);
}

void StreamWriter::finish() {
  State& s = *state_;
  if (!s.message && s.written.messages > 0) return;
  EndBody body;
  body.flags = kWholeMap;
  const State::Message& m = s.open();
  if (m.in_order && m.gone == 0) body.result = m.id.value();
  s.end(body);
}

void StreamWriter::set_header(const MapHeader& header) {
  if (state_->message) {
    throw Error(ErrorCode::kInvalidArgument, "the header of a message cannot change before its end");
  }
  state_->set_header(header);
}

const StreamWritten& StreamWriter::written() const { return state_->written; }

}  // namespace apgm

#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "apgm/core/map_changes.hpp"
#include "apgm/core/source.hpp"
#include "apgm/core/working_memory.hpp"
#include "apgm/format/writer.hpp"

namespace apgm {

struct StreamOptions {
  int level = 3;  ///< zstd, 1..19
  Lossy lossy = Lossy::kNone;
  /// Most bytes of a block, at least kLeastMtu: each fits one datagram. Larger blocks are split. 0: no bound.
  std::uint32_t mtu_bytes = 0;
  /// The map header is sent again once this many bytes, and 16 times its own, went out since: who joins late,
  /// or missed it, can then read on. 0: only at the start of each message.
  std::uint64_t header_every_bytes = std::uint64_t{256} << 10;
  /// A sender that starts again takes a greater one; matters where blocks may be reordered (datagrams).
  std::uint32_t session = 0;

  static constexpr std::uint32_t kLeastMtu = 256;
};

/// How a message ends: what its receiver has then. Content ids of 32 hex digits; empty: not said.
struct MessageEnd {
  std::string base;    ///< of the map that the message changes
  std::string result;  ///< of the map after it
};

/// What went out.
struct StreamWritten {
  std::uint64_t blocks = 0;  ///< parts count one each
  std::uint64_t bytes = 0;
  std::uint64_t messages = 0;
  std::uint64_t layers = 0;
  std::uint64_t gone = 0;
  std::string content_id;  ///< by the last end of a message; empty: not said
};

/// Writes a stream (docs/format.md, "Streams"): blocks that are useful one by one, over pipes, sockets or
/// datagrams. A stream is a row of messages; a message is a whole map (`finish`) or changes of one (`end`).
///
///   StreamWriter writer(send, map.header(), {.mtu_bytes = 1400});
///   for (;;) { copy(changes, types, writer, false); writer.gone(changes.gone()); writer.end({base, result});
///   }
///
/// Guarantees: same header, options and calls give the same bytes; memory does not grow with the map. What
/// the output throws comes out of the call; the block then counts as sent.
/// Thread rule: `pack` from any thread, the rest from one.
class StreamWriter final : public PatchSink, public WorkingMemory {
 public:
  /// Takes the preamble, then one whole block a call: a datagram, if there is an mtu.
  using Output = std::function<void(std::span<const std::byte>)>;

  /// Nothing is sent before the first message.
  /// @throws Error{kInvalidArgument|kLimit} on options or a header that cannot be sent
  StreamWriter(Output output, const MapHeader& header, const StreamOptions& options = {});
  ~StreamWriter() override;

  bool takes_stored() const override;
  void pack(Parcel& parcel) const override;
  std::uint64_t working_bytes(std::uint64_t layer_bytes) const override;
  /// Sends the layers of a patch. Unlike other sinks it takes patches in any order, also twice.
  void put(PatchIndex index, std::span<Parcel> parcels) override;
  /// Sends that layers are gone; their names are types of the header.
  /// @throws Error{kInvalidArgument} on another name
  void gone(std::span<const MapChanges::Gone> gone);
  /// Ends a message of changes. @throws Error{kInvalidArgument} on a content id that is none
  void end(const MessageEnd& ids);
  /// Ends a message that holds a whole map: what it did not name is not part of the map. The id of the map
  /// goes along if patches came in key order. Nothing happens where `end` was called since the last layer.
  void finish() override;

  /// The header of the messages to come: once one was ended.
  void set_header(const MapHeader& header);
  const StreamWritten& written() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// A layer that arrived.
struct StreamLayer {
  const MapHeader& header;    ///< it belongs to
  const LayerInfo& info;      ///< `type` counts in `header`; `stored_bytes` with the block's header
  const StoredLayer& stored;  ///< for a sink that takes stored layers, or `decode`
  std::uint64_t number = 0;   ///< of its block; ascends with time, over restarts too
};
/// @throws Error{kDamaged} if the cells are not what the block says
void decode(const StreamLayer& layer, Layer& out);

/// A layer that is gone from the map.
struct StreamGone {
  const MapHeader& header;
  PatchIndex patch;
  TypeId type = 0;
  std::uint64_t number = 0;
};

/// The end of a message.
struct StreamEnd {
  const MapHeader& header;
  MessageEnd ids;
  bool whole = false;         ///< the message holds a whole map
  std::uint64_t layers = 0;   ///< that were sent in it
  std::uint64_t gone = 0;     ///< the same
  std::uint64_t first = 0;    ///< number of the message's first block
  std::uint64_t number = 0;   ///< of its last
  std::uint64_t missing = 0;  ///< blocks between that did not arrive by now
};

/// Takes what a stream holds, in the order of arrival. Of each layer and its going, no older state comes
/// after a newer one, whatever the order of arrival. References hold during the call.
class StreamHandler {
 public:
  virtual ~StreamHandler() = default;
  /// The header changed, or is the first.
  virtual void header(const MapHeader& /*header*/) {}
  virtual void layer(const StreamLayer& layer) = 0;
  virtual void gone(const StreamGone& gone) = 0;
  virtual void end(const StreamEnd& /*end*/) {}
};

/// What arrived, and what did not.
struct StreamReport {
  std::uint64_t bytes = 0;
  std::uint64_t blocks = 0;  ///< whole ones, each once; parts count one each
  std::uint64_t messages = 0;
  std::uint64_t layers = 0;
  std::uint64_t gone = 0;
  std::uint64_t damaged = 0;         ///< blocks whose header is whole and the rest is not, or breaks a rule
  std::uint64_t lost = 0;            ///< blocks up to the newest that did not arrive whole; damaged ones too
  std::uint64_t duplicate = 0;       ///< came again
  std::uint64_t late = 0;            ///< came when it could no longer be told where they belong: not used
  std::uint64_t superseded = 0;      ///< layers, or their going, that came after a newer state: not used
  std::uint64_t incomplete = 0;      ///< split blocks of which parts are missing
  std::uint64_t without_header = 0;  ///< blocks whose map header did not arrive
  std::uint64_t unsupported = 0;     ///< blocks that need a newer reader
  std::uint64_t skipped_bytes = 0;   ///< that belong to no whole block
  bool ended = false;                ///< the newest block ends a message
  std::string fault;                 ///< the first thing found wrong; empty: none

  /// Nothing is missing, up to the end of a message.
  bool complete() const;
};

/// Bounds of what a reader keeps, whatever arrives.
struct StreamLimits {
  /// Of a block, 256 at least; larger ones count as damaged. No layer of the format needs more than the
  /// default.
  std::uint64_t max_block_bytes = std::uint64_t{72} << 20;
  /// Of parts of blocks, and of blocks that wait for their header; beyond it the oldest are given up.
  std::uint64_t max_kept_bytes = std::uint64_t{128} << 20;
};

/// Takes a stream apart as it arrives, cut in any way. Both hashes of every block are checked; after damage
/// it goes on at the next sync mark. Nothing that arrives makes it throw. Blocks that are damaged, lost,
/// doubled or reordered are counted, and cost what they hold.
///
/// Memory: max_block_bytes twice, max_kept_bytes, and some 10 MB; map headers up to 64 MB. Time: linear.
/// One thread. What the handler throws comes out of the call; the reader goes on behind that block.
class StreamReader {
 public:
  /// @param handler  outlives the reader
  explicit StreamReader(StreamHandler& handler, const StreamLimits& limits = {});
  ~StreamReader();

  /// The next bytes of a pipe or a socket. A preamble begins a new stream.
  void feed(std::span<const std::byte> bytes);
  /// One datagram: one or more whole blocks.
  void datagram(std::span<const std::byte> bytes);
  /// No more bytes come.
  void finish();
  StreamReport report() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// True if `head`, at least 16 bytes, starts a stream rather than a file.
bool is_stream(std::span<const std::byte> head);

}  // namespace apgm

#include <algorithm>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/format/stream.hpp"
#include "content_id.hpp"
#include "stream_framer.hpp"
#include "stream_messages.hpp"
#include "stream_numbers.hpp"
#include "stream_order.hpp"
#include "stream_parts.hpp"

namespace apgm {

using namespace format;

namespace {

using HeaderPtr = std::shared_ptr<const StreamHeader>;

constexpr std::size_t kMostHeaders = 4;
constexpr std::uint64_t kMostHeaderBytes = std::uint64_t{16} << 20;  // of all but the newest
constexpr std::uint64_t kWaitOverhead = 256;

}  // namespace

struct StreamReader::State final : Framer::Taker {
  State(StreamHandler& to, const StreamLimits& bounds)
      : handler(to), limits(bounds), framer(largest(bounds)), parts(largest(bounds)) {}

  static std::uint64_t largest(const StreamLimits& bounds) {
    return std::max<std::uint64_t>(bounds.max_block_bytes, StreamOptions::kLeastMtu);
  }

  StreamHandler& handler;
  StreamLimits limits;
  Framer framer;
  StreamReport counts;      // but for what `report` adds
  bool is_pipe = true;      // preambles begin anew
  bool is_foreign = false;  // since a preamble that cannot be read

  std::optional<std::uint32_t> session;
  std::uint64_t base = 0;  // numbers of streams before this one
  Numbers numbers;
  Parts parts;
  Order order;
  std::vector<HeaderPtr> headers;  // newest last
  std::uint64_t header_number = 0;
  std::uint64_t told = 0;                                   // hash of the header the handler knows
  std::map<std::uint64_t, std::vector<std::byte>> waiting;  // for their header, by number
  std::uint64_t waiting_bytes = 0;
  StoredLayer stored;

  /// Runs `work`; what it finds wrong is counted. @return true if all is right
  template <typename Work>
  bool checked(Work work) {
    try {
      work();
      return true;
    } catch (const Error& e) {
      ++(e.code() == ErrorCode::kUnsupported ? counts.unsupported : counts.damaged);
      framer.report().note(e.message());
      return false;
    }
  }

  void restart() {
    base += numbers.greatest();
    counts.lost += numbers.missing();
    counts.incomplete += parts.size();
    counts.without_header += waiting.size();
    numbers = {};
    parts.clear();
    order.clear(0);
    waiting.clear();
    waiting_bytes = 0;
    header_number = 0;
    session.reset();
  }

  void preamble(const Preamble& p) override {
    is_foreign = p.major != kMajor || p.incompat != kStreamBit;
    if (is_foreign) {
      ++counts.unsupported;
      framer.report().note(p.major == kMajor && p.incompat == 0 ? "a map file, not a stream"
                                                                : "a stream of a newer format");
    }
    if (is_pipe) restart();
  }

  void block(const Block& block, Bytes bytes) override {
    if (is_foreign) {
      ++counts.unsupported;
      return;
    }
    const std::uint64_t number = number_of(block.header.commit);
    if (!checked([&] {
          if (number == 0) throw Error(ErrorCode::kDamaged, "a block has no number");
        })) {
      return;
    }
    const std::uint32_t its_session = session_of(block.header.commit);
    if (session && its_session < *session) {
      ++counts.late;
      return;
    }
    if (session && its_session > *session) restart();
    session = its_session;
    switch (numbers.look(number)) {
      case Numbers::Arrival::kDuplicate:
        ++counts.duplicate;
        return;
      case Numbers::Arrival::kLate:
        ++counts.late;
        return;
      case Numbers::Arrival::kNew:
        break;
    }
    if (block.header.kind == Kind::kPart) return take_part(block, number);
    take_whole(block, bytes, number, [&] { accept(block, number); });
  }

  /// The block of `number` arrived whole and keeps the rules.
  void accept(const Block& block, std::uint64_t number) {
    ++counts.blocks;
    numbers.add(number);
    if (number == numbers.greatest()) counts.ended = block.header.kind == Kind::kEnd;
  }

  void take_part(const Block& block, std::uint64_t number) {
    std::optional<Parts::Whole> whole;
    if (!checked([&] { whole = parts.add(block, number); })) return;
    accept(block, number);
    if (!whole) return keep_within_limits();
    Block joined;
    const bool is_right = checked([&] {
      joined = check_block(whole->bytes);
      if (joined.header.kind == Kind::kPart ||
          joined.header.commit != stream_commit(*session, whole->number) ||
          joined.header.context != block.header.context || joined.header.key != block.header.key) {
        throw Error(ErrorCode::kDamaged, "parts do not make the block they belong to");
      }
    });
    bool is_taken = false;
    if (is_right)
      take_whole(joined, whole->bytes, whole->number, [&] {
        is_taken = true;
        if (whole->number == numbers.greatest()) counts.ended = joined.header.kind == Kind::kEnd;
      });
    if (!is_taken) numbers.remove(whole->number);
  }

  /// A block that is not a part. @param accepted  called once it is known to keep the rules
  template <typename Accepted>
  void take_whole(const Block& block, Bytes bytes, std::uint64_t number, Accepted accepted) {
    switch (block.header.kind) {
      case Kind::kMapHeader: {
        HeaderPtr header;
        if (!checked([&] { header = read_stream_header(block); })) return;
        accepted();
        return take_header(std::move(header), number);
      }
      case Kind::kLayer:
      case Kind::kGone:
      case Kind::kEnd: {
        const HeaderPtr header = find_header(block.header.context);
        if (header == nullptr) {
          accepted();
          return wait(bytes, number);
        }
        return take_content(block, *header, number, accepted);
      }
      default:
        if (checked([&] { check_other(block); })) accepted();
    }
  }

  HeaderPtr find_header(std::uint64_t hash) const {
    const auto it = std::ranges::find(headers, hash, &StreamHeader::hash);
    return it == headers.end() ? nullptr : *it;
  }

  void take_header(HeaderPtr header, std::uint64_t number) {
    std::erase_if(headers, [&](const HeaderPtr& h) { return h->hash == header->hash; });
    headers.push_back(header);
    std::uint64_t bytes = 0;
    for (const HeaderPtr& h : headers) bytes += h->bytes;
    while (headers.size() > 1 &&
           (headers.size() > kMostHeaders || bytes - header->bytes > kMostHeaderBytes)) {
      bytes -= headers.front()->bytes;
      headers.erase(headers.begin());
    }
    if (number > header_number) {
      header_number = number;
      if (std::exchange(told, header->hash) != header->hash) handler.header(header->header);
    }
    for (auto it = waiting.begin(); it != waiting.end();) {
      const auto now = it++;
      if (read_as<BlockHeader>(now->second).context != header->hash) continue;
      const auto node = waiting.extract(now);
      waiting_bytes -= node.mapped().size() + kWaitOverhead;
      bool is_taken = false;
      take_content(check_block(node.mapped()), *header, node.key(), [&] { is_taken = true; });
      if (!is_taken) numbers.remove(node.key());
    }
  }

  void wait(Bytes bytes, std::uint64_t number) {
    waiting.emplace(number, std::vector<std::byte>(bytes.begin(), bytes.end()));
    waiting_bytes += bytes.size() + kWaitOverhead;
    keep_within_limits();
  }

  void keep_within_limits() {
    while (parts.memory() + waiting_bytes > limits.max_kept_bytes) {
      const bool oldest_waits =
          !waiting.empty() && (parts.size() == 0 || waiting.begin()->first < parts.oldest());
      if (oldest_waits) {
        const auto node = waiting.extract(waiting.begin());
        waiting_bytes -= node.mapped().size() + kWaitOverhead;
        ++counts.without_header;
        numbers.remove(node.key());
      } else {
        const std::uint64_t number = parts.oldest();
        ++counts.incomplete;
        if (parts.drop_oldest()) numbers.remove(number);
      }
    }
  }

  template <typename Accepted>
  void take_content(const Block& block, const StreamHeader& header, std::uint64_t number, Accepted accepted) {
    const TypeTable& types = header.header.types;
    LayerBlock layer;
    std::vector<GoneRecord> gone;
    EndBody end;
    const Kind kind = block.header.kind;
    if (!checked([&] {
          if (kind == Kind::kLayer) layer = read_stream_layer(block, types);
          if (kind == Kind::kGone) gone = read_gone(block, types);
          if (kind == Kind::kEnd) end = read_end(block);
        })) {
      return;
    }
    if (kind != Kind::kEnd && number < numbers.greatest() && !order.knows(number)) {
      ++counts.late;
      return;
    }
    accepted();
    if (kind == Kind::kLayer) give_layer(layer, block.body, header, number);
    if (kind == Kind::kGone) give_gone(gone, header, number);
    if (kind == Kind::kEnd) give_end(end, header, number);
    // Only behind the block: all of a list of what is gone is judged by what came before it.
    if (numbers.closed() && waiting.empty()) order.clear(numbers.greatest());
  }

  /// True if no newer state of the layer came before.
  bool take_newest(PatchIndex patch, std::uint64_t name, std::uint64_t number) {
    const bool is_newest = order.take(place_hash(patch, name), number);
    if (!is_newest) ++counts.superseded;
    return is_newest;
  }

  void give_layer(const LayerBlock& layer, Bytes body, const StreamHeader& header, std::uint64_t number) {
    ++counts.layers;
    if (!take_newest(layer.info.patch, header.names[layer.info.type], number)) return;
    stored.encoding = layer.info.encoding;
    stored.step = layer.info.step;
    stored.content_hash = layer.info.content_hash;
    stored.error_bound = layer.error_bound;
    stored.bytes.assign(body.begin(), body.end());
    handler.layer({header.header, layer.info, stored, base + number});
  }

  void give_gone(const std::vector<GoneRecord>& gone, const StreamHeader& header, std::uint64_t number) {
    counts.gone += gone.size();
    for (const GoneRecord& r : gone) {
      const PatchIndex patch{r.ix, r.iy};
      if (take_newest(patch, header.names[r.type], number)) {
        handler.gone({header.header, patch, r.type, base + number});
      }
    }
  }

  void give_end(const EndBody& end, const StreamHeader& header, std::uint64_t number) {
    ++counts.messages;
    const std::uint64_t first = number_of(end.first);
    handler.end({header.header,
                 {id_text(end.base), id_text(end.result)},
                 (end.flags & kWholeMap) != 0,
                 end.layers,
                 end.gone,
                 base + first,
                 base + number,
                 numbers.missing(first, number)});
  }
};

bool StreamReport::complete() const {
  return ended && lost == 0 && damaged == 0 && late == 0 && incomplete == 0 && without_header == 0 &&
         unsupported == 0 && skipped_bytes == 0;
}

StreamReader::StreamReader(StreamHandler& handler, const StreamLimits& limits)
    : state_(std::make_unique<State>(handler, limits)) {}

StreamReader::~StreamReader() = default;

void StreamReader::feed(std::span<const std::byte> bytes) {
  state_->is_pipe = true;
  state_->framer.feed(bytes, *state_);
}

void StreamReader::datagram(std::span<const std::byte> bytes) {
  state_->is_pipe = false;
  state_->is_foreign = false;
  state_->framer.datagram(bytes, *state_);
}

void StreamReader::finish() { state_->framer.finish(*state_); }

StreamReport StreamReader::report() const {
  const State& s = *state_;
  StreamReport report = s.counts;
  const FramerReport& framer = s.framer.report();
  report.bytes = framer.bytes;
  report.damaged += framer.damaged;
  report.unsupported += framer.unsupported;
  report.skipped_bytes = framer.skipped_bytes;
  report.lost += s.numbers.missing();
  report.incomplete += s.parts.size();
  report.without_header += s.waiting.size();
  report.fault = framer.fault;
  return report;
}

bool is_stream(std::span<const std::byte> head) {
  if (head.size() < offsetof(Preamble, ro_compat)) return false;
  return std::memcmp(head.data(), kMagic.data(), kMagic.size()) == 0 &&
         (read_as<std::uint32_t>(head.subspan(offsetof(Preamble, incompat))) & kStreamBit) != 0;
}

void decode(const StreamLayer& layer, Layer& out) {
  decode_layer({layer.info, layer.stored.error_bound}, layer.stored.bytes,
               layer.header.types[layer.info.type], out);
}

}  // namespace apgm

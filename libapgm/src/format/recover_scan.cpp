#include "recover_scan.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "apgm/core/error.hpp"
#include "index.hpp"
#include "layer_block.hpp"
#include "map_header.hpp"

namespace apgm::format {
namespace {

/// Payloads up to this size are searched for a flipped bit: half a million tries, some seconds.
constexpr std::uint64_t kRepairBytes = 64 * 1024;
constexpr std::uint64_t kMaxKept = std::uint64_t{256} << 20;
constexpr std::uint64_t kProgressBytes = std::uint64_t{16} << 20;

/// Larger than any block of its kind that is read.
bool too_large(const BlockHeader& h) {
  switch (h.kind) {
    case Kind::kMapHeader:
      return h.payload_bytes > kMaxHeaderBytes;
    case Kind::kLayer:
      return h.payload_bytes > Layer::kMaxBytes + Layer::kMaxBytes / 16 + 16'384;
    case Kind::kIndexPage:
      return h.payload_bytes > kPageEntries * sizeof(IndexEntry) * 2 + 4096;
    case Kind::kIndexRoot:
      return h.payload_bytes > kMaxRootBytes;
    case Kind::kFooter:
      return h.payload_bytes != sizeof(Footer);
    default:
      return true;
  }
}

}  // namespace

void Salvage::scan(std::uint64_t end, const std::function<void(std::uint64_t)>& progress) {
  end_ = end;
  BlockScan scan(file_, 0, end);
  Spot spot;
  std::uint64_t told = 0;
  while (scan.next(spot)) {
    take(spot);
    if (spot.offset + spot.bytes - told < kProgressBytes) continue;
    told = spot.offset + spot.bytes;
    progress(told);
  }
  progress(end);
}

void Salvage::take(const Spot& found) {
  Spot spot = found;
  if (spot.offset == 0 && spot.state == Spot::State::kNoBlock) {  // the preamble, or what is left of it
    if (spot.bytes <= sizeof(Preamble)) return;
    spot.offset += sizeof(Preamble);
    spot.bytes -= sizeof(Preamble);
  }
  switch (spot.state) {
    case Spot::State::kWhole:
      return take_block(spot.header, spot.offset, spot.payload);
    case Spot::State::kBadPayload:
      return repair_payload(spot);
    case Spot::State::kNoBlock:
      return repair_gap(spot);
    case Spot::State::kBadPadding:
      break;
  }
  if (too_large(spot.header)) return give_up(spot);
  std::vector<std::byte> block(spot.bytes);
  file_.read(spot.offset, block);
  std::fill(block.begin() + static_cast<std::ptrdiff_t>(sizeof(BlockHeader) + spot.header.payload_bytes),
            block.end(), std::byte{0});
  if (!keep(spot.offset, std::move(block))) give_up(spot);
}

/// @param payload  all of it, or the FlatBuffer of a large one
void Salvage::take_block(const BlockHeader& h, std::uint64_t offset, Bytes payload) {
  const FoundBlock found{offset, sizeof(BlockHeader) + padded(h.payload_bytes), h.payload_hash, h.commit};
  if (h.version != 1 || h.flags > 1 || h.context != 0 || too_large(h)) return;
  switch (h.kind) {
    case Kind::kMapHeader:
      return headers.push_back(found);
    case Kind::kIndexPage:
      return pages.push_back(found);
    case Kind::kIndexRoot:
      return roots.push_back(found);
    case Kind::kFooter:
      return footers.push_back(found);
    case Kind::kLayer:
      break;
    default:
      return;
  }
  try {
    if (payload.size() < h.meta_bytes) throw Error(ErrorCode::kDamaged, "the block is malformed");
    FoundLayer layer;
    layer.info = read_layer_block({h, payload.first(h.meta_bytes), payload.subspan(h.meta_bytes)}).info;
    layer.info.stored_bytes = static_cast<std::uint32_t>(found.bytes);
    layer.info.locator = offset;
    layer.key = h.key;
    layer.payload_hash = h.payload_hash;
    layer.commit = h.commit;
    layers.push_back(layer);
  } catch (const Error&) {
    broken.push_back({offset, found.bytes, Kind::kLayer, h.key, h.commit, "the block is malformed"});
  }
}

void Salvage::repair_payload(const Spot& spot) {
  const BlockHeader& h = spot.header;
  const std::uint64_t bytes = sizeof(BlockHeader) + padded(h.payload_bytes);
  std::uint64_t& work = h.kind == Kind::kLayer ? layer_work_ : other_work_;
  const std::uint64_t cost = h.payload_bytes * h.payload_bytes * 8;
  if (h.payload_bytes > kRepairBytes || too_large(h) || cost > work || bytes != spot.bytes)
    return give_up(spot);
  work -= cost;
  std::vector<std::byte> block(bytes);
  file_.read(spot.offset, block);
  if (!repair_bit(std::span(block).subspan(sizeof(BlockHeader), h.payload_bytes), h.payload_hash)) {
    return give_up(spot);
  }
  if (!keep(spot.offset, std::move(block))) give_up(spot);
}

/// Where there is no header, one with a flipped bit may stand, and behind its block another.
void Salvage::repair_gap(Spot spot) {
  while (spot.bytes > 0) {
    std::array<std::byte, sizeof(BlockHeader)> head;
    if (spot.bytes < head.size()) break;
    file_.read(spot.offset, head);
    if (!repair_header(head)) break;
    const auto h = read_as<BlockHeader>(head);
    const std::uint64_t rest = end_ - spot.offset - head.size();
    if (h.sync != kSync || too_large(h) || h.meta_bytes > h.payload_bytes || h.meta_bytes % 8 != 0 ||
        padded(h.payload_bytes) > rest) {
      break;
    }
    std::vector<std::byte> block(head.size() + padded(h.payload_bytes));
    if (block.size() > spot.bytes) break;
    file_.read(spot.offset, block);
    std::memcpy(block.data(), head.data(), head.size());
    const std::uint64_t bytes = block.size();
    if (!keep(spot.offset, std::move(block))) break;
    spot.offset += bytes;
    spot.bytes -= bytes;
  }
  if (spot.bytes > 0) give_up(spot);
}

/// Takes a block that was repaired, if it is whole now.
bool Salvage::keep(std::uint64_t offset, std::vector<std::byte> block) {
  if (block.size() > kMaxKept - kept_bytes_) return false;
  try {
    const Block parsed = check_block(block);
    kept_bytes_ += block.size();
    ++repaired;
    const Bytes payload = Bytes(block).subspan(sizeof(BlockHeader), parsed.header.payload_bytes);
    take_block(parsed.header, offset, payload);
    kept_.emplace(offset, std::move(block));
    return true;
  } catch (const Error&) {
    return false;
  }
}

void Salvage::give_up(const Spot& spot) {
  const bool header = spot.state == Spot::State::kBadPayload || spot.state == Spot::State::kBadPadding;
  broken.push_back({spot.offset, spot.bytes, header ? spot.header.kind : Kind{}, spot.header.key,
                    spot.header.commit, spot.why});
}

std::vector<std::byte> Salvage::block(std::uint64_t offset, std::uint64_t bytes) const {
  if (const auto kept = kept_.find(offset); kept != kept_.end()) return kept->second;
  std::vector<std::byte> out(bytes);
  file_.read(offset, out);
  return out;
}

std::optional<Footer> Salvage::footer(const FoundBlock& found) const {
  const std::vector<std::byte> bytes = block(found.offset, found.bytes);
  const Block parsed = parse_block(bytes, Kind::kFooter);
  if (!parsed.meta.empty() || parsed.body.size() != sizeof(Footer)) return std::nullopt;
  const auto footer = read_as<Footer>(parsed.body);
  if (footer.tail != kTail || footer.commits != found.commit) return std::nullopt;
  return footer;
}

std::uint64_t Salvage::memory_bytes() const {
  constexpr std::uint64_t kLists = 3;  // as found, as chosen, as merged
  return kLists * layers.capacity() * sizeof(FoundLayer) + broken.capacity() * sizeof(Broken) +
         (headers.size() + pages.size() + roots.size() + footers.size()) * sizeof(FoundBlock) + kept_bytes_;
}

bool Salvage::find_header(std::uint64_t offset, std::uint64_t bytes, std::uint64_t hash,
                          std::uint64_t commit) {
  if (bytes < sizeof(BlockHeader) || offset > end_ || bytes > end_ - offset) return false;
  std::vector<std::byte> payload(bytes - sizeof(BlockHeader));
  file_.read(offset + sizeof(BlockHeader), payload);
  const std::uint64_t cost = payload.size() * payload.size() * 8;
  if (hash_of(payload) != hash) {
    if (payload.size() > kRepairBytes || cost > other_work_) return false;
    other_work_ -= cost;
    if (!repair_bit(payload, hash)) return false;
  }
  std::vector<std::byte> block;
  append_block(block, Kind::kMapHeader, 0, payload, {}, commit);
  return keep(offset, std::move(block));
}

}  // namespace apgm::format

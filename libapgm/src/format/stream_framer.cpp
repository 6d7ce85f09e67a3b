#include "stream_framer.hpp"

#include <algorithm>

#include "apgm/core/error.hpp"

namespace apgm::format {
namespace {

constexpr std::uint64_t kMostCredit = std::uint64_t{1} << 30;
constexpr std::uint64_t kCreditPerByte = 4;

/// True if `rest` starts with a mark, or ends within what may be one.
template <typename T>
bool may_start(Bytes rest, const std::array<T, 8>& mark) {
  return std::memcmp(rest.data(), mark.data(), std::min(rest.size(), mark.size())) == 0;
}

/// Bytes before the first place where a block or a preamble may start.
std::size_t to_mark(Bytes rest) {
  for (std::size_t i = 0; i < rest.size(); ++i) {
    if (rest[i] != std::byte(kSync[0]) && rest[i] != std::byte(kMagic[0])) continue;
    const Bytes here = rest.subspan(i);
    if (may_start(here, kSync) || may_start(here, kMagic)) return i;
  }
  return rest.size();
}

}  // namespace

Framer::Step Framer::skip(std::size_t bytes) {
  report_.skipped_bytes += bytes;
  return {bytes};
}

/// What lies in a bad block is looked through, since its header may speak of bytes that are lost.
Framer::Step Framer::bad_block(Bytes rest, std::uint64_t size) {
  ++report_.damaged;
  const std::uint64_t bytes = std::min<std::uint64_t>(size, rest.size());
  if (credit_ < bytes) return skip(bytes);
  credit_ -= bytes;
  return skip(sizeof(BlockHeader));
}

Framer::Step Framer::step(Bytes rest, bool at_end) {
  if (const std::size_t gap = to_mark(rest); gap > 0) {
    report_.note("bytes that belong to no block");
    return skip(gap);
  }
  if (rest.size() < sizeof(BlockHeader)) {
    need_ = sizeof(BlockHeader);
    if (!at_end) return {};
    report_.note("the stream ends within a block");
    return skip(std::min(rest.size(), kSync.size()));
  }
  return may_start(rest, kMagic) ? step_preamble(rest) : step_block(rest, at_end);
}

Framer::Step Framer::step_preamble(Bytes rest) {
  preamble_ = read_as<Preamble>(rest);
  if (preamble_.hash == hash_of(rest.first(offsetof(Preamble, hash))))
    return {sizeof(Preamble), What::kPreamble};
  report_.note("a preamble fails its checksum");
  return skip(kMagic.size());
}

Framer::Step Framer::step_block(Bytes rest, bool at_end) {
  if (!is_block_header(rest.first(sizeof(BlockHeader)))) {
    report_.note("a block header fails its checksum");
    return skip(kSync.size());
  }
  const auto header = read_as<BlockHeader>(rest);
  if (header.payload_bytes > max_block_bytes_ - sizeof(BlockHeader)) {
    ++report_.damaged;
    report_.note("a block is larger than the limit of " + std::to_string(max_block_bytes_) + " bytes");
    return skip(sizeof(BlockHeader));
  }
  const std::uint64_t size = sizeof(BlockHeader) + padded(header.payload_bytes);
  if (rest.size() < size) {
    need_ = size;
    if (!at_end) return {};
    report_.note("the stream ends within a block");
    return bad_block(rest, size);
  }
  try {
    const Bytes whole = rest.first(size);
    block_bytes_.assign(whole.begin(), whole.end());
    block_ = check_block(block_bytes_);
  } catch (const Error& e) {
    report_.note(e.message());
    if (e.code() != ErrorCode::kUnsupported) return bad_block(rest, size);
    ++report_.unsupported;
    return skip(size);
  }
  return {size, What::kBlock};
}

void Framer::emit(What what, Taker& taker) {
  if (what == What::kPreamble) taker.preamble(preamble_);
  if (what == What::kBlock) taker.block(block_, block_bytes_);
}

void Framer::drain(bool at_end, Taker& taker) {
  need_ = 0;
  while (at_ < buffer_.size()) {
    const Step done = step(Bytes(buffer_).subspan(at_), at_end);
    if (done.bytes == 0) break;
    at_ += done.bytes;
    emit(done.what, taker);
  }
  compact();
}

/// Moves what is left to the front once it is the smaller part, so that each byte moves once or twice.
void Framer::compact() {
  if (at_ < buffer_.size() - at_) return;
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(at_));
  at_ = 0;
}

void Framer::earn(std::size_t bytes) {
  report_.bytes += bytes;
  credit_ = std::min(kMostCredit, credit_ + kCreditPerByte * bytes);
}

void Framer::feed(Bytes bytes, Taker& taker) {
  earn(bytes.size());
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  if (buffer_.size() - at_ >= need_) drain(false, taker);
}

void Framer::finish(Taker& taker) { drain(true, taker); }

void Framer::datagram(Bytes bytes, Taker& taker) {
  earn(bytes.size());
  while (!bytes.empty()) {
    const Step done = step(bytes, true);
    bytes = bytes.subspan(done.bytes);
    emit(done.what, taker);
  }
  need_ = 0;
}

}  // namespace apgm::format

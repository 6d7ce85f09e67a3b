#include "stream_parts.hpp"

#include "apgm/core/error.hpp"

namespace apgm::format {
namespace {

/// What a piece takes beside its bytes.
constexpr std::uint64_t kPieceOverhead = 256;

[[noreturn]] void fail(const char* what) { throw Error(ErrorCode::kDamaged, what); }

std::uint64_t memory_of(const std::vector<std::byte>& piece) { return piece.size() + kPieceOverhead; }

}  // namespace

Parts::Group Parts::shape_of(const Block& part, const PartHead& head, std::uint64_t number) const {
  const std::uint64_t size = part.body.size() - sizeof(PartHead);
  if (head.count < 2 || head.index >= head.count || number <= head.index ||
      head.bytes < sizeof(BlockHeader) || head.bytes % 8 != 0 || head.bytes > max_block_bytes_ || size == 0 ||
      number + (head.count - 1 - head.index) > 0xffffffffu) {
    fail("the head of a part is malformed");
  }
  Group group;
  group.count = head.count;
  group.bytes = head.bytes;
  group.context = part.header.context;
  group.key = part.header.key;
  const std::uint64_t others = head.count - 1;
  const bool is_last = head.index == others;
  if (is_last && (size > head.bytes || (head.bytes - size) % others != 0))
    fail("a part is of the wrong size");
  group.share = is_last ? (head.bytes - size) / others : size;
  // No product overflows: the share is below 2^33, the count below 2^32 and at most the whole is compared.
  if (group.share == 0 || group.share % 8 != 0 || (head.bytes - 1) / group.share != others ||
      (is_last && size > group.share)) {
    fail("a part is of the wrong size");
  }
  return group;
}

std::optional<Parts::Whole> Parts::add(const Block& part, std::uint64_t number) {
  if (!part.meta.empty() || part.body.size() < sizeof(PartHead)) fail("a part is malformed");
  const auto head = read_as<PartHead>(part.body);
  const Group shape = shape_of(part, head, number);
  const std::uint64_t last = number + (head.count - 1 - head.index);
  const auto [it, is_new] = groups_.try_emplace(last, shape);
  Group& group = it->second;
  if (!is_new && (group.count != shape.count || group.bytes != shape.bytes || group.share != shape.share ||
                  group.context != shape.context || group.key != shape.key)) {
    fail("a part does not fit the others of its block");
  }
  const Bytes piece = part.body.subspan(sizeof(PartHead));
  const auto [at, added] = group.pieces.try_emplace(head.index, piece.begin(), piece.end());
  if (added) memory_ += memory_of(at->second);
  if (group.pieces.size() < group.count) return {};
  Whole whole{join(group), last};
  groups_.erase(it);
  return whole;
}

std::vector<std::byte> Parts::join(const Group& group) {
  std::vector<std::byte> bytes;
  bytes.reserve(group.bytes);
  for (const auto& [index, piece] : group.pieces) {
    bytes.insert(bytes.end(), piece.begin(), piece.end());
    memory_ -= memory_of(piece);
  }
  return bytes;
}

bool Parts::drop_oldest() {
  const auto it = groups_.begin();
  const bool has_last = it->second.pieces.contains(it->second.count - 1);
  for (const auto& [index, piece] : it->second.pieces) memory_ -= memory_of(piece);
  groups_.erase(it);
  return has_last;
}

void Parts::clear() {
  groups_.clear();
  memory_ = 0;
}

}  // namespace apgm::format

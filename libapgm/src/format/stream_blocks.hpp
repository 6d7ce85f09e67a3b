#pragma once

#include <array>
#include <cstdint>

#include "block.hpp"

namespace apgm::format {

/// Head of the body of a Part block; bytes of the whole block follow.
struct PartHead {
  std::uint32_t index = 0;
  std::uint32_t count = 0;  ///< at least 2
  std::uint64_t bytes = 0;  ///< of the whole block
};
static_assert(sizeof(PartHead) == 16);

/// One layer that is gone; the body of a Gone block is a list of them.
struct GoneRecord {
  std::int32_t ix = 0;
  std::int32_t iy = 0;
  std::uint16_t type = 0;
  std::array<std::uint16_t, 3> reserved{};
};
static_assert(sizeof(GoneRecord) == 16);
inline constexpr std::size_t kMaxGoneRecords = 4096;  // of a block

/// Body of an End block.
struct EndBody {
  std::uint64_t layers = 0;
  std::uint64_t gone = 0;
  std::uint64_t first = 0;  ///< commit of the message's first block
  std::uint64_t flags = 0;
  std::array<std::byte, 16> result{};  ///< content ids; all zero: not said
  std::array<std::byte, 16> base{};
};
static_assert(sizeof(EndBody) == 64);
inline constexpr std::uint64_t kWholeMap = 1;  // of flags

/// The commit of a block in a stream: session in the upper half, its number from 1 in the lower one.
constexpr std::uint64_t stream_commit(std::uint32_t session, std::uint64_t number) {
  return std::uint64_t{session} << 32 | number;
}
constexpr std::uint32_t session_of(std::uint64_t commit) { return static_cast<std::uint32_t>(commit >> 32); }
constexpr std::uint64_t number_of(std::uint64_t commit) { return commit & 0xffffffffu; }

}  // namespace apgm::format

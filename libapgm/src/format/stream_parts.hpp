#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "stream_blocks.hpp"

namespace apgm::format {

/// Puts split blocks together. Memory is that of the parts that arrived, whatever they say of the whole.
class Parts {
 public:
  explicit Parts(std::uint64_t max_block_bytes) : max_block_bytes_(max_block_bytes) {}

  /// A part and its number. Gives the whole block, not checked, with the number of its last part, once all
  /// parts are there.
  /// @throws Error{kDamaged} on a part that breaks a rule, or does not fit the others
  struct Whole {
    std::vector<std::byte> bytes;
    std::uint64_t number = 0;
  };
  std::optional<Whole> add(const Block& part, std::uint64_t number);

  std::uint64_t memory() const { return memory_; }
  std::size_t size() const { return groups_.size(); }
  /// Number of the oldest split block, which is there.
  std::uint64_t oldest() const { return groups_.begin()->first; }
  /// @return whether its last part was there
  bool drop_oldest();
  void clear();

 private:
  struct Group {
    std::uint32_t count = 0;
    std::uint64_t bytes = 0;
    std::uint64_t share = 0;  ///< bytes of every part but the last
    std::uint64_t context = 0;
    std::uint64_t key = 0;
    std::map<std::uint32_t, std::vector<std::byte>> pieces;
  };
  Group shape_of(const Block& part, const PartHead& head, std::uint64_t number) const;
  std::vector<std::byte> join(const Group& group);

  std::uint64_t max_block_bytes_;
  std::uint64_t memory_ = 0;
  std::map<std::uint64_t, Group> groups_;  // by number of the last part
};

}  // namespace apgm::format

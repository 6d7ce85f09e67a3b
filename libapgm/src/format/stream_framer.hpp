#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "block.hpp"

namespace apgm::format {

/// What a Framer found wrong.
struct FramerReport {
  std::uint64_t bytes = 0;
  std::uint64_t damaged = 0;
  std::uint64_t unsupported = 0;
  std::uint64_t skipped_bytes = 0;
  std::string fault;  ///< the first

  void note(const std::string& what) {
    if (fault.empty()) fault = what;
  }
};

/// Finds the blocks in bytes that arrive in any pieces, and goes on at the next sync mark after damage.
///
/// Memory: twice the largest block, and what one call gives. Time: linear in the bytes, since what is hashed
/// in vain is bounded: beyond that a bad block is skipped whole.
class Framer {
 public:
  class Taker {
   public:
    virtual ~Taker() = default;
    virtual void preamble(const Preamble& preamble) = 0;
    /// @param bytes  of the whole block; hold during the call, 16-aligned
    virtual void block(const Block& block, Bytes bytes) = 0;
  };

  explicit Framer(std::uint64_t max_block_bytes) : max_block_bytes_(max_block_bytes) {}

  void feed(Bytes bytes, Taker& taker);
  /// Takes what is left as damage, and looks for whole blocks in it.
  void finish(Taker& taker);
  /// Bytes that stand for themselves; what `feed` left waits on.
  void datagram(Bytes bytes, Taker& taker);
  FramerReport& report() { return report_; }
  const FramerReport& report() const { return report_; }

 private:
  enum class What : std::uint8_t { kNothing, kPreamble, kBlock };
  struct Step {
    std::size_t bytes = 0;  ///< 0: more are needed
    What what = What::kNothing;
  };
  Step step(Bytes rest, bool at_end);
  Step step_preamble(Bytes rest);
  Step step_block(Bytes rest, bool at_end);
  Step skip(std::size_t bytes);
  Step bad_block(Bytes rest, std::uint64_t size);
  void emit(What what, Taker& taker);
  void drain(bool at_end, Taker& taker);
  void earn(std::size_t bytes);
  void compact();

  std::uint64_t max_block_bytes_;
  std::uint64_t credit_ = std::uint64_t{16} << 20;  // bytes that may be hashed in vain
  std::vector<std::byte> buffer_;
  std::size_t at_ = 0;      // of the first byte in `buffer_` that is not done
  std::uint64_t need_ = 0;  // bytes from there without which nothing can be told
  Preamble preamble_;
  Block block_;
  std::vector<std::byte> block_bytes_;
  FramerReport report_;
};

}  // namespace apgm::format

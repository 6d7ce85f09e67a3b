#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <unordered_map>
#include <vector>

#include "apgm/core/source.hpp"
#include "block.hpp"
#include "input_file.hpp"
#include "scan.hpp"

namespace apgm::format {

/// A whole block of a damaged file.
struct FoundBlock {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
  std::uint64_t payload_hash = 0;
  std::uint64_t commit = 0;
  bool stray = false;  ///< of another file, it seems (mark_strays)
};

struct FoundLayer {
  LayerInfo info;  ///< type in the table of its commit; locator: offset in the file
  std::uint64_t key = 0;
  std::uint64_t payload_hash = 0;
  std::uint64_t commit = 0;
  bool stray = false;
};

/// Bytes that are no whole block.
struct Broken {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
  Kind kind{};  ///< 0: not even a header
  std::uint64_t key = 0;
  std::uint64_t commit = 0;
  const char* why = "";
  bool stray = false;
};

/// All that is whole in a file, wherever it stands. Blocks with one flipped bit are repaired: their checksum
/// tells which bit it was.
class Salvage {
 public:
  explicit Salvage(const InputFile& file) : file_(file) {}
  /// @param end       bytes of the file to look at
  /// @param progress  called with the bytes done
  void scan(std::uint64_t end, const std::function<void(std::uint64_t)>& progress);
  /// Bytes of a whole block, repaired where it was.
  std::vector<std::byte> block(std::uint64_t offset, std::uint64_t bytes) const;
  /// What a whole Footer block says; nullopt if it is malformed. Its places are not held against the file:
  /// bytes may be missing before it.
  std::optional<Footer> footer(const FoundBlock& found) const;
  /// Looks for the payload of the MapHeader block at `offset`, whose own header is lost, by its hash; adds it
  /// to `headers`. False if it is not there.
  bool find_header(std::uint64_t offset, std::uint64_t bytes, std::uint64_t hash, std::uint64_t commit);

  /// Most memory that what was found takes, with what is made of it.
  std::uint64_t memory_bytes() const;

  std::vector<FoundBlock> headers, pages, roots, footers;
  std::vector<FoundLayer> layers;
  std::vector<Broken> broken;
  std::uint64_t repaired = 0;
  bool sealed = false;  ///< the file is a map of one commit, not an archive

 private:
  void take(const Spot& spot);
  void take_block(const BlockHeader& header, std::uint64_t offset, Bytes payload);
  void repair_payload(const Spot& spot);
  void repair_gap(Spot spot);
  bool keep(std::uint64_t offset, std::vector<std::byte> block);
  void give_up(const Spot& spot);

  const InputFile& file_;
  std::uint64_t end_ = 0;
  std::unordered_map<std::uint64_t, std::vector<std::byte>> kept_;  // by offset: blocks that were repaired
  std::uint64_t kept_bytes_ = 0;
  std::uint64_t layer_work_ = std::uint64_t{24} << 30;  // bytes that may be hashed for repairs
  std::uint64_t other_work_ = std::uint64_t{64} << 30;
};

}  // namespace apgm::format

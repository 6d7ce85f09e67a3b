#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/core/source.hpp"

namespace apgm {

struct RecoverOptions {
  const MapHeader* header = nullptr;   ///< frame and types of the map, for a file whose own header is lost
  int threads = 0;                     ///< 0: all cores
  std::size_t max_losses = 10'000;     ///< that are told of; all are counted
  std::uint64_t max_memory_bytes = 0;  ///< 0: no bound but the number of layers
  const std::atomic<bool>* cancel = nullptr;                              ///< set: Error{kCancelled}
  std::function<void(std::uint64_t done, std::uint64_t total)> progress;  ///< bytes; from the caller's thread
};

/// What a damaged file no longer holds.
struct Loss {
  std::string text;          ///< "patch (17,-3) layer 'occupancy': a block fails its checksum"
  std::uint64_t offset = 0;  ///< byte in the damaged file
  std::optional<PatchIndex> patch;
  std::string layer;  ///< name of its type; empty: none, or not known
};

struct RecoverReport {
  std::uint64_t commit = 0;              ///< whose state this is, as far as it is there
  std::uint64_t older_commits = 0;       ///< of an archive, that are left out: those whose footer is whole
  bool index = false;                    ///< an index said which layers belong to it
  std::uint64_t layers = 0;              ///< that are whole
  std::uint64_t repaired = 0;            ///< blocks of which one flipped bit was found by their checksum
  std::uint64_t uncommitted_bytes = 0;   ///< of an append that was interrupted; not part of the map
  std::uint64_t uncommitted_layers = 0;  ///< that are whole in it; if there are any, that is a loss
  std::uint64_t loss_count = 0;
  std::vector<Loss> losses;  ///< by offset; the first max_losses
};

/// No map header is left and none was given: RecoverOptions::header can stand in for it. A kDamaged error.
class HeaderLost final : public Error {
 public:
  using Error::Error;
};

/// What is left of a damaged .apgm file, as a source: a Writer makes a sound file of it. Of an archive it is
/// the last commit. docs/reliability.md says how much is saved of what.
///
/// A commit of an archive that was not finished is left out, which counts as a loss if layers or an index of
/// it are whole: it may have been finished, and only its footer be lost.
///
/// Guarantees: nothing is invented: every layer is a block under right checksums whose cells decode and have
/// their content hash. Where the index is whole it says what belongs to the map; else the newest commit of
/// each layer counts. Time linear in the file (and a bounded time for repairs), some 150 bytes of memory a
/// layer, whatever the bytes are.
/// Thread rule: as PatchSource.
class Recovery final : public PatchSource {
 public:
  /// @param path  a file, or "-" for standard input
  /// @throws Error{kDamaged} if no block is whole, HeaderLost if no map header is left and none is given;
  ///         {kForeign} if it neither starts as an .apgm file nor holds a block; {kLimit} if the budget does
  ///         not hold the list of layers, or the largest layer beside it;
  ///         {kUnsupported|kUnreadable|kCancelled}
  explicit Recovery(const std::string& path, const RecoverOptions& options = {});
  /// Of a file's bytes in memory, which outlive it.
  explicit Recovery(std::span<const std::byte> bytes, const RecoverOptions& options = {});
  ~Recovery() override;

  const RecoverReport& report() const;

  /// The file's header, without what belongs to an archive only, and the step "recover" in its history.
  const MapHeader& header() const override;
  Summary summary() const override;
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override;
  void load(const LayerInfo& info, Layer& out) const override;
  bool load_stored(const LayerInfo& info, StoredLayer& out) const override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace apgm

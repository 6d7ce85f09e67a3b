#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apgm/core/map_changes.hpp"
#include "apgm/core/source.hpp"
#include "apgm/core/working_memory.hpp"
#include "apgm/format/reader.hpp"

namespace apgm {

struct ArchiveOptions {
  bool create = false;  ///< make the archive if nothing is there
  /// Number the last commit must have, 0 if the archive must be new: for who decided on what to commit by
  /// looking at it earlier.
  std::optional<std::uint64_t> expected = {};
  int level = 3;  ///< zstd, 1..19
  /// Check and count all, write nothing. The archive is not locked; whether a new file can be made is not
  /// seen.
  bool dry_run = false;
};

/// What lies after an archive's last commit: of an append that was interrupted, or of a commit whose end was
/// damaged since; they look the same. `Recovery` of a copy tells what it holds.
struct TornEnd {
  std::uint64_t bytes = 0;
  std::uint64_t layers = 0;  ///< that are whole
};

struct CommitOptions {
  std::string message = {};            ///< UTF-8; may be empty
  std::vector<std::string> tags = {};  ///< names to give the commit, taken from others that have them
};

struct CommitReport {
  std::uint64_t number = 0;
  std::string content_id;  ///< 32 hex digits
  std::uint64_t file_bytes = 0;
  std::uint64_t added_bytes = 0;
  std::uint64_t patches = 0;
  std::uint64_t layers = 0;
  std::uint64_t layers_written = 0;  ///< the others are shared with earlier commits
};

/// Adds one commit to an archive (docs/archive.md): takes the layers that changed since the last one, shares
/// the others. Memory: a page of the index at a time.
///
/// Guarantees: the archive holds the new commit after `finish`, flushed to the disk, and is as it was before,
/// but for a torn end, if anything fails or the writer is destroyed before; also if the power fails in
/// between. The exception: where flushing the commit's last bytes fails and they cannot be taken back either,
/// or the process or the power ends there, the commit may be found whole later. One writer at a
/// time: the archive is locked from construction on; readers are never in the way. Thread rule: `pack` from
/// any thread, the rest from one.
class ArchiveWriter final : public PatchSink, public WorkingMemory {
 public:
  /// Locks the archive. What an interrupted append left stays until `begin` has checked its arguments.
  /// @throws Error as Reader; {kOutput} if it is missing (without `create`), may not be written, or another
  ///         writes to it; {kIncompatible} if it is a sealed map, or its last commit is not the expected one;
  ///         {kInvalidArgument} on the level
  explicit ArchiveWriter(const std::string& path, const ArchiveOptions& options = {});
  ~ArchiveWriter() override;

  /// The last commit; nullptr in a new archive.
  const Reader* last() const;
  /// What `begin` cuts off.
  TornEnd torn() const;

  /// Must be called once, before the first `put`.
  /// @param header  of the new commit, with all its types; `apgm.archive.*` in its metadata is left out
  /// @param gone    layers of the last commit that the new one lacks, by (curve_key, name); may be missing
  /// @throws Error{kIncompatible} if the frame is not the archive's, {kInvalidArgument|kLimit} on what cannot
  ///         be stored
  void begin(const MapHeader& header, std::vector<MapChanges::Gone> gone = {},
             const CommitOptions& options = {});

  bool takes_stored() const override { return true; }
  void pack(Parcel& parcel) const override;
  std::uint64_t working_bytes(std::uint64_t layer_bytes) const override;
  /// Layers that differ from those of the last commit, or are new. Those of the last commit whose type has
  /// another space or background in the header of `begin`, or is no more, are gone unless they come.
  void put(PatchIndex index, std::span<Parcel> parcels) override;
  void finish() override;
  /// After `finish`.
  const CommitReport& report() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Gives a commit a name, or another name's commit that name. Adds a few hundred bytes and the map's header.
/// @param number  0: the last commit
/// @param torn    if not null: what was cut off
/// @return        the number
/// @throws Error as ArchiveWriter; {kInvalidArgument} if the name is not `[A-Za-z_][A-Za-z0-9_.+-]*` of 1 to
///         64 bytes or is "now", or there is no such commit
std::uint64_t tag_commit(const std::string& archive, const std::string& name, std::uint64_t number = 0,
                         TornEnd* torn = nullptr);
/// Takes a name away. @throws Error{kInvalidArgument} if no commit has it
void remove_tag(const std::string& archive, const std::string& name, TornEnd* torn = nullptr);

struct CompactOptions {
  std::uint64_t keep = 0;   ///< how many of the newest commits stay, besides those with tags; 0: all
  std::string output = {};  ///< another file, which must not exist; empty: in place
  bool overwrite = false;   ///< replace `output`
  std::function<bool()> cancelled = {};  ///< asked now and then; true stops with Error{kCancelled}
  std::uint64_t max_memory_bytes = 0;    ///< 0: no bound
  std::function<void(std::uint64_t done, std::uint64_t total)> progress = {};  ///< bytes; ends early
};

struct CompactReport {
  std::uint64_t commits_before = 0, commits = 0;
  std::uint64_t file_bytes_before = 0, file_bytes = 0;
  TornEnd torn = {};  ///< what was left out after the last commit
};

/// Writes an archive anew: without commits that are not kept, torn ends and replaced headers; layers in index
/// order, equal ones once. Numbers, content ids, messages and tags stay. The new file appears whole or not at
/// all, and no commit of it has another content id than its layers. Memory: some 120 bytes for each layer
/// that is written.
/// @throws Error as ArchiveWriter; {kDamaged} if a commit that is kept is not what its content id says;
///         over_budget()
CompactReport compact_archive(const std::string& archive, const CompactOptions& options = {});

/// True if a text may be a tag in a file.
bool is_tag_name(const std::string& text);
/// True if a commit may be given that tag: is_tag_name, and not "now", which is a time wherever a commit is
/// asked for by number, tag or time.
bool may_be_given(const std::string& tag);

}  // namespace apgm

#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "apgm/core/map_changes.hpp"
#include "archive_target.hpp"
#include "commit_writer.hpp"

namespace apgm::format {

/// Changes to the last commit of an archive, merged with its index as they come. Layers that are not
/// mentioned are shared; only where the number of their type changed they are stored again. Those whose type
/// is no more, or has another space or background, are gone.
class ArchiveMerge {
 public:
  /// @param target  outlives it
  /// @param header  of the new commit, as it is to be stored
  /// @param gone    layers of the last commit that the new one lacks, by (curve_key, name); may be missing
  /// @throws Error{kIncompatible} if the frame is another, {kInvalidArgument} if `gone` is not in order
  ArchiveMerge(CommitTarget& target, const MapHeader& header, std::vector<MapChanges::Gone> gone);

  /// The layers of the next changed patch, as PatchSink::put. One without data takes away what was there.
  void put(std::span<const Parcel> parcels);
  /// Closes the target.
  Footer finish();

  std::uint64_t layers_written() const { return layers_written_; }
  const CommitWriter& commit() const { return commit_; }

 private:
  /// Place in the index, comparable over both type tables: a type counts by its name's place among all names.
  using Place = std::pair<std::uint64_t, std::size_t>;

  void rank_types(const TypeTable& before, const TypeTable& after);
  const IndexEntry* head();
  Place place_of(const IndexEntry& entry) const { return {entry.key, old_ranks_[entry.type]}; }
  void keep_until(const std::optional<Place>& end);
  void keep(const IndexEntry& entry);
  bool is_gone(std::uint64_t key, const std::string& layer);

  CommitTarget& target_;
  TypeTable types_;
  CommitWriter commit_;
  std::vector<MapChanges::Gone> gone_;
  std::size_t gone_at_ = 0;
  std::vector<std::size_t> old_ranks_, new_ranks_;
  std::vector<std::optional<TypeId>> new_types_;  // of each old type; none: its layers are gone
  std::size_t page_ = 0;
  std::size_t entry_ = 0;
  std::vector<IndexEntry> entries_;
  std::vector<std::byte> buffer_;
  std::uint64_t layers_written_ = 0;
};

}  // namespace apgm::format

#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apgm/core/source.hpp"
#include "apgm/core/working_memory.hpp"
#include "apgm/ops/changes_source.hpp"

namespace apgm {

/// The header of a delta (docs/delta.md): that of the map the changes lead to, with what is gone, the content
/// id of the base and that of the result in its metadata. A delta is a Writer with it, to which the changes
/// are copied: `copy(changes, header.types, writer, false)` passes stored bytes on.
/// @param base_id, result_id  content ids of the two maps, as content_id_of() gives them
/// @throws Error{kIncompatible} if one of the maps is itself a delta or a message of changes, {kLimit} as
///         store_gone()
MapHeader delta_header(const ChangesSource& changes, const std::string& base_id,
                       const std::string& result_id);

/// What a delta or a stream of changes has to name: what is gone, but for layers of types that the result
/// does not have. These go with their type.
std::vector<MapChanges::Gone> gone_by_name(const ChangesSource& changes);

/// True if a file with this header is a delta or another message of changes, thus part of a map.
bool holds_changes(const MapHeader& header);

/// Makes it the header of a map: a part of a delta, or one with other cells, does not lead to the map that
/// the delta names.
void drop_changes(MapHeader& header);

struct ApplyNames {
  std::string base = "the base";  ///< for messages
  std::string delta = "the delta";
};

/// That changes of any kind are for this base: a delta, or a stream of changes.
/// @param base_id    content id of the map they change
/// @param result_id  of the map they lead to; empty: not said
/// @throws Error{kIncompatible} if `base` is another map, or itself a delta
void check_base(const PatchSource& base, const std::string& base_id, const std::string& result_id,
                const ApplyNames& names = {});

/// A map, from its base and a delta: neither is decoded where it knows its content hashes. Deltas chain: an
/// AppliedSource may be the base of the next. Memory: 16 bytes for each layer of the delta and each that is
/// gone.
///
/// Guarantees: content_id() is that which the delta names, checked against the layers of both indexes; the
/// header is that of the map the delta was made from. A Writer without loss makes the same file from it as
/// from that map if the layers that did not change are stored the same in the base.
/// Thread rule: as PatchSource. Both sources outlive it.
class AppliedSource final : public PatchSource, public WorkingMemory {
 public:
  /// @throws Error{kForeign} if the delta names no base, {kIncompatible} if it is for another base or frame,
  ///         {kDamaged} if it breaks its rules or does not lead to the map it names
  AppliedSource(const PatchSource& base, const PatchSource& delta, const ApplyNames& names = {});
  ~AppliedSource() override;

  const MapHeader& header() const override;
  Summary summary() const override;
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override;
  void load(const LayerInfo& info, Layer& out) const override;
  bool load_stored(const LayerInfo& info, StoredLayer& out) const override;
  /// The larger of both sources': a layer comes from one of them.
  std::uint64_t working_bytes(std::uint64_t layer_bytes) const override;
  std::string content_id() const override;

  struct State;  ///< private to the library

 private:
  std::unique_ptr<State> state_;
};

}  // namespace apgm

#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "apgm/core/patch_store.hpp"
#include "apgm/core/source.hpp"

namespace apgm {

/// Patches in a file without a name: a PatchStore that takes any number of them in any order, and a
/// PatchSource that gives them in key order, as stored bytes too. Memory: the index alone, some 130 bytes a
/// layer. Space of patches that were replaced or taken is given back once it is more than half of the file:
/// what is left moves to a new file. If there is no room for that, it happens later; it is no error.
///
/// Guarantees: a Writer of the same level makes the same file from it as from the map itself; all that is
/// read back is checked against its checksum, Error{kDamaged} if it fails.
/// Thread rule: as PatchSource while nothing is stored or taken.
class ScratchMap final : public PatchStore, public PatchSource {
 public:
  /// @param directory  where the file lies; nothing is visible there
  /// @param level      zstd, 1..19
  /// @throws Error{kOutput} if no file can be made there, {kInvalidArgument} on the level or the header
  ScratchMap(MapHeader header, const std::string& directory, int level = 3);
  ~ScratchMap() override;
  /// Most memory that `store` and `take` keep from call to call, beside the index.
  /// @param layer_bytes  values of the largest layer, whose masses are canonical
  static std::uint64_t working_bytes(std::uint64_t layer_bytes, int level);

  void set_types(const TypeTable& types) override;
  /// @throws Error{kOutput} if the disk is full, {kInvalidArgument} on masses out of range; the patch it held
  /// before is then still there
  void store(const Patch& patch) override;
  bool take(PatchIndex index, Patch& out) override;
  /// Keeps one layer as it is stored, in place of what it held of that patch and type.
  /// @param parcel  of state kStored, with bytes that decode to cells of its type
  /// @throws Error{kOutput}; what it held is then unchanged
  void put(const Parcel& parcel);
  /// Forgets one layer. @return false if there was none
  bool erase(PatchIndex patch, TypeId type);

  /// Replaces the header; layers follow their type's name.
  /// @throws Error{kIncompatible} as set_types, or if the frame is another
  void set_header(MapHeader header);
  /// Layers it holds.
  std::uint64_t layers() const;
  /// Bytes the file takes.
  std::uint64_t file_bytes() const;

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

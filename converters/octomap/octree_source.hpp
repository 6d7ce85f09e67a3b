#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "apgm/core/working_memory.hpp"
#include "converters/common/grid_fit.hpp"
#include "converters/common/listed_source.hpp"
#include "converters/octomap/octree_walk.hpp"

namespace apgm::converters {

enum class OctreeMode : std::uint8_t {
  kProjection,  ///< one layer `occupancy`: the columns
  kSlices,      ///< one layer type a height
};

/// Type of the cells between two heights one voxel apart: "occupancy_z32768" stands on the tree's origin.
/// Five digits of the octree's key, so that names sort by height.
LayerType slice_type(int z_key, double resolution_m);

/// An octree seen as patches. Holds the tree; makes the cells of a layer when it is loaded.
class OctreeSource final : public ListedSource, public WorkingMemory {
 public:
  /// @param heights  keys of the voxels to read
  /// @param max_memory_bytes  what the list of patches may take; 0: no bound
  /// @throws Error{kLimit} if there are more slices than a map has types, or patches out of range
  OctreeSource(std::unique_ptr<const ::octomap::OcTree> tree, const GridFit& fit, OctreeMode mode,
               KeyRange heights, const Findings& findings, std::uint64_t max_memory_bytes = 0);
  ~OctreeSource() override;

  void load(const LayerInfo& info, Layer& out) const override;
  std::uint64_t working_bytes(std::uint64_t layer_bytes) const override;

 private:
  void layers_of(PatchIndex patch, std::vector<LayerInfo>& out) const override;
  void describe(const Findings& findings, std::uint64_t max_memory_bytes);
  KeyBox column_of(PatchIndex patch) const;
  PatchRange patches_of(const OctreeLeaf& leaf) const;
  void load_slice(PatchIndex patch, int z_key, Layer& out) const;
  void load_projection(PatchIndex patch, Layer& out) const;

  std::unique_ptr<const ::octomap::OcTree> tree_;
  GridFit fit_;
  OctreeMode mode_;
  KeyRange heights_;
  std::vector<int> slice_keys_;      // by TypeId
  std::vector<TypeId> slice_types_;  // by key - heights_.min
};

}  // namespace apgm::converters

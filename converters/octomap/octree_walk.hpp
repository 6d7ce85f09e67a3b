#pragma once

#include <octomap/OcTree.h>

#include <algorithm>
#include <cstdint>

#include "converters/octomap/octree_file.hpp"

namespace apgm::converters {

/// Voxel keys [min, max) along one axis.
struct KeyRange {
  int min = 0;
  int max = 1 << kTreeDepth;
  bool empty() const { return max <= min; }
  std::int64_t size() const { return max - min; }
  KeyRange clipped(KeyRange to) const { return {std::max(min, to.min), std::min(max, to.max)}; }
};

struct KeyBox {
  KeyRange x, y, z;
};

/// The part of a leaf that lies in the box that was asked for.
struct OctreeLeaf {
  KeyBox box;
  float log_odds = 0;
};

namespace detail {

template <class Visit>
void visit_node(const ::octomap::OcTree& tree, const ::octomap::OcTreeNode* node, int x, int y, int z,
                int size, const KeyBox& wanted, Visit& visit) {
  const KeyBox box{KeyRange{x, x + size}.clipped(wanted.x), KeyRange{y, y + size}.clipped(wanted.y),
                   KeyRange{z, z + size}.clipped(wanted.z)};
  if (box.x.empty() || box.y.empty() || box.z.empty()) return;
  if (!tree.nodeHasChildren(node)) {
    visit(OctreeLeaf{box, node->getLogOdds()});
    return;
  }
  const int half = size / 2;
  for (unsigned child = 0; child < 8; ++child) {
    if (!tree.nodeChildExists(node, child)) continue;
    visit_node(tree, tree.getNodeChild(node, child), x + ((child & 1u) != 0 ? half : 0),
               y + ((child & 2u) != 0 ? half : 0), z + ((child & 4u) != 0 ? half : 0), half, wanted, visit);
  }
}

}  // namespace detail

/// Calls `visit(const OctreeLeaf&)` for every leaf that meets `wanted`, in the tree's own order. Goes no
/// deeper than the tree, which is read-only: from any thread.
template <class Visit>
void visit_leaves(const ::octomap::OcTree& tree, const KeyBox& wanted, Visit visit) {
  if (tree.getRoot() != nullptr)
    detail::visit_node(tree, tree.getRoot(), 0, 0, 0, 1 << kTreeDepth, wanted, visit);
}

}  // namespace apgm::converters

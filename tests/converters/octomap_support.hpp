#pragma once

#include <octomap/OcTree.h>

#include <cstring>

#include "converters/octomap/octomap.hpp"
#include "tests/converters/support.hpp"

namespace apgm::converters::testing {

inline ::octomap::OcTreeKey key(int x, int y, int z) {
  const auto k = [](int i) { return static_cast<::octomap::key_type>(32768 + i); };
  return {k(x), k(y), k(z)};
}

inline std::string save_ot(::octomap::OcTree& tree, const std::string& path) {
  tree.updateInnerOccupancy();
  EXPECT_TRUE(tree.write(path));
  return path;
}

inline std::unique_ptr<::octomap::OcTree> load_ot(const std::string& path) {
  return std::unique_ptr<::octomap::OcTree>(
      dynamic_cast<::octomap::OcTree*>(::octomap::AbstractOcTree::read(path)));
}

/// Compares two trees voxel by voxel at full depth, pruned or not. `same(log odds, log odds)`.
template <class Same>
std::size_t differing_leaves(const ::octomap::OcTree& ta, const ::octomap::OcTreeNode* a,
                             const ::octomap::OcTree& tb, const ::octomap::OcTreeNode* b, const Same& same) {
  if (a == nullptr || b == nullptr) return a == b ? 0 : 1;
  const bool inner_a = ta.nodeHasChildren(a), inner_b = tb.nodeHasChildren(b);
  if (!inner_a && !inner_b) return same(a->getLogOdds(), b->getLogOdds()) ? 0 : 1;
  std::size_t differing = 0;
  for (unsigned i = 0; i < 8; ++i) {
    const auto* ca = !inner_a ? a : ta.nodeChildExists(a, i) ? ta.getNodeChild(a, i) : nullptr;
    const auto* cb = !inner_b ? b : tb.nodeChildExists(b, i) ? tb.getNodeChild(b, i) : nullptr;
    differing += differing_leaves(ta, ca, tb, cb, same);
  }
  return differing;
}

/// The bytes of a tree file with nodes given as they stand in it.
inline std::string tree_file(bool binary, const std::string& nodes, std::size_t size,
                             const std::string& res = "0.1", const std::string& id = "OcTree") {
  return std::string("# Octomap OcTree ") + (binary ? "binary " : "") + "file\n# a comment\nid " + id +
         "\nsize " + std::to_string(size) + "\nres " + res + "\ndata\n" + nodes;
}

/// A node of an .ot file.
inline std::string node(float log_odds, unsigned children) {
  std::string bytes(5, '\0');
  std::memcpy(bytes.data(), &log_odds, 4);
  bytes[4] = static_cast<char>(children);
  return bytes;
}

}  // namespace apgm::converters::testing

#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "apgm/format/output_file.hpp"

namespace octomap {
class OcTree;
}

namespace apgm::converters {

/// Levels of an octree below its root; keys have as many bits.
inline constexpr int kTreeDepth = 16;
/// Key of the voxel whose lower corner is the tree's origin.
inline constexpr int kOriginKey = 1 << (kTreeDepth - 1);

/// The text in front of an octree's nodes.
struct OctreeHeader {
  bool binary = false;  ///< .bt: free or occupied; else .ot: log odds
  std::uint64_t nodes = 0;
  double resolution_m = 0;
  std::size_t data_at = 0;  ///< byte where the nodes start
};

/// True if a file that starts with `head` is an octree of either kind.
bool is_octree(std::string_view head);

/// @throws Error{kForeign} if it is no octree, {kUnsupported} if not of type OcTree, {kDamaged} if a field is
///         missing or out of range
OctreeHeader parse_octree_header(std::string_view bytes);

/// Walks the nodes without building anything: 16 levels at most, ends with the bytes, as many as the header
/// says, no inner node without children, no NaN. OctoMap's own reader checks none of this.
/// @return octree_memory() of the tree
/// @throws Error{kDamaged} with the byte
std::uint64_t check_octree_nodes(std::string_view bytes, const OctreeHeader& header);

/// Memory of a tree, as an allocator that rounds to 16 bytes gives it.
/// @param inner  nodes with children, of all `nodes`
std::uint64_t octree_memory(std::uint64_t nodes, std::uint64_t inner);

/// Reads and checks a whole file, then has OctoMap build the tree.
/// @param max_memory_bytes  bound of the file and the tree; 0: none
/// @throws Error{kUnreadable|kForeign|kUnsupported|kDamaged|kLimit}
std::unique_ptr<::octomap::OcTree> read_octree(const std::string& path, std::uint64_t max_memory_bytes = 0);

/// Writes the file of a tree, with the resolution in as many digits as it needs. @throws Error{kOutput}
void write_octree(const ::octomap::OcTree& tree, bool binary, OutputFile& file);

}  // namespace apgm::converters

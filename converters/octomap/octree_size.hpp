#pragma once

#include <cstdint>
#include <string>

namespace apgm::converters {

/// What an octree takes once it is in memory.
struct OctreeSize {
  std::uint64_t leaves = 0;
  std::uint64_t bytes = 0;  ///< OcTree::memoryUsage: nodes and their lists of children, no allocator headers
};

/// Of a file. @throws Error as read_octree
OctreeSize octree_size(const std::string& path, std::uint64_t max_memory_bytes = 0);

}  // namespace apgm::converters

#include "converters/octomap/octree_size.hpp"

#include <octomap/OcTree.h>

#include "converters/octomap/octree_file.hpp"

namespace apgm::converters {

OctreeSize octree_size(const std::string& path, std::uint64_t max_memory_bytes) {
  const auto tree = read_octree(path, max_memory_bytes);
  return {tree->getNumLeafNodes(), tree->memoryUsage()};
}

}  // namespace apgm::converters

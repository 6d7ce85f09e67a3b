#pragma once

#include <octomap/OcTree.h>

#include <memory>
#include <string>

namespace apgm::bench {

/// @throws Error{kUnreadable} if the file holds no OcTree
std::unique_ptr<octomap::OcTree> read_tree(const std::string& path);
/// The whole tree, or the occupancy thresholded to two bits where the name ends in .bt.
/// @throws Error{kOutput}
void write_tree(octomap::OcTree& tree, const std::string& path);

}  // namespace apgm::bench

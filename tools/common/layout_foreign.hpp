#pragma once

#include <string>
#include <vector>

#include "tools/common/comparison.hpp"

namespace apgm::tools {

/// What a map costs in the formats of others: "octomap-ot" and "octomap-bt" (leaves, OcTree::memoryUsage,
/// bytes of the file), "geotiff" (a file a layer, ZSTD) and "numpy" (one .npz, deflate), which lie on disk
/// alone. Really written by the converters of this build, to a temporary directory that is gone afterwards,
/// and read back for the change of belief. A format that is not in this build, or that cannot hold the map,
/// is a row with a note.
/// Without a bound of memory an octree may take 4 GiB; with one a format that would take more than is left is
/// a row with a note, too.
/// @throws Error{kOutput} if the directory cannot be made or is full, {kCancelled}
std::vector<LayoutRow> foreign_rows(const Map& map, const CompareOptions& options);

}  // namespace apgm::tools

#include "octomap_tree.hpp"

#include "apgm/core/error.hpp"

namespace apgm::bench {

std::unique_ptr<octomap::OcTree> read_tree(const std::string& path) {
  std::unique_ptr<octomap::AbstractOcTree> any(octomap::AbstractOcTree::read(path));
  auto* tree = dynamic_cast<octomap::OcTree*>(any.get());
  if (tree == nullptr) throw Error(ErrorCode::kUnreadable, "cannot read an octree from '" + path + "'");
  any.release();
  return std::unique_ptr<octomap::OcTree>(tree);
}

void write_tree(octomap::OcTree& tree, const std::string& path) {
  const bool bits = path.ends_with(".bt");
  // Const: writeBinary() itself would threshold the tree in memory.
  if (!(bits ? tree.writeBinaryConst(path) : tree.write(path))) {
    throw Error(ErrorCode::kOutput, "cannot write '" + path + "'");
  }
}

}  // namespace apgm::bench

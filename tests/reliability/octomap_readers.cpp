#include <octomap/OcTree.h>

#include <bit>
#include <cstdint>
#include <sstream>

#include "random_map.hpp"
#include "readers.hpp"

namespace apgm::test {
namespace {

/// Every node with its place and value, and the resolution: queries of any depth are answered by these.
std::string content_of(const octomap::OcTree& tree) {
  std::ostringstream out;
  out << tree.getResolution();
  for (auto node = tree.begin_tree(); node != tree.end_tree(); ++node) {
    const octomap::OcTreeKey key = node.getKey();
    out << ' ' << key[0] << ',' << key[1] << ',' << key[2] << ',' << node.getDepth() << ','
        << std::bit_cast<std::uint32_t>(node->getLogOdds());
  }
  return out.str();
}

octomap::OcTree scene() {
  octomap::OcTree tree(0.1);
  Random random(3);
  for (int i = 0; i < 1500; ++i) {
    const octomap::point3d at(static_cast<float>(random.in(-20, 20)) * 0.1f,
                              static_cast<float>(random.in(-20, 20)) * 0.1f,
                              static_cast<float>(random.in(0, 8)) * 0.1f);
    tree.updateNode(at, random.chance(0.4));
  }
  tree.updateInnerOccupancy();
  return tree;
}

class Octomap final : public Format {
 public:
  explicit Octomap(bool binary) : binary_(binary) {
    octomap::OcTree tree = scene();
    std::ostringstream out;
    if (binary) {
      tree.writeBinary(out);
    } else {
      tree.write(out);
    }
    file_ = out.str();
    read(file_);
    good_ = last_;
  }
  std::string name() const override { return binary_ ? "OctoMap .bt" : "OctoMap .ot"; }
  const std::string& file() const override { return file_; }

  Answer read(const std::string& bytes) override {
    last_.clear();
    std::istringstream in(bytes);
    if (binary_) {
      octomap::OcTree tree(0.1);
      if (!tree.readBinary(in)) return Answer::kDetected;
      last_ = content_of(tree);
    } else {
      const std::unique_ptr<octomap::AbstractOcTree> tree(octomap::AbstractOcTree::read(in));
      const auto* octree = dynamic_cast<const octomap::OcTree*>(tree.get());
      if (octree == nullptr) return Answer::kDetected;
      last_ = content_of(*octree);
    }
    return last_ == good_ ? Answer::kSame : Answer::kWrong;
  }

 private:
  bool binary_;
  std::string file_, good_, last_;
};

}  // namespace

std::unique_ptr<Format> octomap_ot() { return std::make_unique<Octomap>(false); }
std::unique_ptr<Format> octomap_bt() { return std::make_unique<Octomap>(true); }

}  // namespace apgm::test

// The peer of apgm-merge: one octree from two .ot files, as OctoMap's users do it.
//
// Lazy updates, with one pass over the inner nodes at the end, are the fastest way OctoMap offers.

#include <octomap/OcTree.h>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "apgm/core/error.hpp"
#include "octomap_tree.hpp"
#include "samples/support/program.hpp"

namespace {

using apgm::Error;
using apgm::ErrorCode;
using apgm::bench::read_tree;
using apgm::bench::write_tree;

constexpr const char* kUsage =
    "usage: octomap-merge A.ot B.ot -o OUT.ot\n"
    "\n"
    "Adds the log-odds of every leaf of B to A and prints the seconds of each phase.\n";

class Phases {
 public:
  void done(const char* name) {
    const auto now = Clock::now();
    std::printf("%-12s %8.3f s\n", name, seconds(now - last_));
    last_ = now;
  }
  void total() const { std::printf("%-12s %8.3f s\n", "total", seconds(Clock::now() - start_)); }

 private:
  using Clock = std::chrono::steady_clock;
  static double seconds(Clock::duration d) { return std::chrono::duration<double>(d).count(); }
  Clock::time_point start_ = Clock::now();
  Clock::time_point last_ = start_;
};

/// Leaves above the lowest level stand for all voxels below them.
void add_leaves(const octomap::OcTree& from, octomap::OcTree& to) {
  for (auto leaf = from.begin_leafs(), end = from.end_leafs(); leaf != end; ++leaf) {
    const unsigned side = 1u << (from.getTreeDepth() - leaf.getDepth());
    const octomap::OcTreeKey low = leaf.getIndexKey();
    for (unsigned z = 0; z < side; ++z) {
      for (unsigned y = 0; y < side; ++y) {
        for (unsigned x = 0; x < side; ++x) {
          const octomap::OcTreeKey key(static_cast<octomap::key_type>(low[0] + x),
                                       static_cast<octomap::key_type>(low[1] + y),
                                       static_cast<octomap::key_type>(low[2] + z));
          to.updateNode(key, leaf->getLogOdds(), /*lazy_eval=*/true);
        }
      }
    }
  }
}

void merge(std::vector<std::string> args) {
  const std::string output = apgm::samples::take_option(args, "-o");
  apgm::samples::expect_arguments(args, 2);
  if (output.empty()) throw apgm::samples::UsageError{"no output: pass -o OUT.ot"};
  Phases phases;
  const auto a = read_tree(args[0]);
  phases.done("read_a");
  const auto b = read_tree(args[1]);
  phases.done("read_b");
  if (a->getResolution() != b->getResolution()) {
    throw Error(ErrorCode::kIncompatible, "the trees have different resolutions");
  }
  add_leaves(*b, *a);
  phases.done("update");
  a->updateInnerOccupancy();
  phases.done("inner");
  write_tree(*a, output);
  phases.done("write");
  phases.total();
}

}  // namespace

int main(int argc, char** argv) {
  return apgm::samples::run_program("octomap-merge", kUsage, argc, argv, merge);
}

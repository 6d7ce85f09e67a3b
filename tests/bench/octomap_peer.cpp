// OctoMap's reading, writing and cropping, as its users do them.

#include <octomap/OcTree.h>

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "octomap_tree.hpp"
#include "peer.hpp"
#include "samples/support/program.hpp"

namespace {

using apgm::bench::parse_box;
using apgm::bench::read_tree;
using apgm::bench::time_runs;
using apgm::bench::write_tree;
using apgm::samples::UsageError;

constexpr const char* kUsage =
    "usage: octomap-peer read TREE [--runs N]\n"
    "       octomap-peer write TREE OUT.ot|OUT.bt [--runs N]\n"
    "       octomap-peer crop TREE OUT.ot --bbox XMIN,YMIN,XMAX,YMAX\n"
    "\n"
    "read and write print the seconds of each run. The box is in metres of the tree.\n";

void read(const std::vector<std::string>& args, int runs) {
  // The tree of the run before is freed outside of the time.
  std::unique_ptr<octomap::OcTree> tree;
  std::vector<double> seconds;
  for (int i = 0; i <= runs; ++i) {
    tree.reset();
    const double s = apgm::bench::seconds_of([&] { tree = read_tree(args[0]); });
    if (i > 0) seconds.push_back(s);
  }
  apgm::bench::print_timings("read", seconds);
}

void write(const std::vector<std::string>& args, int runs) {
  const auto tree = read_tree(args[0]);
  time_runs("write", runs, [&] { write_tree(*tree, args[1]); });
}

void crop(const std::vector<std::string>& args, const std::array<double, 4>& box) {
  const auto [left, low, right, high] = box;
  const auto tree = read_tree(args[0]);
  octomap::OcTree out(tree->getResolution());
  const octomap::point3d from(static_cast<float>(left), static_cast<float>(low), -0.05f),
      to(static_cast<float>(right), static_cast<float>(high), 0.05f);
  // One layer of voxels: eight equal children never come together, so every leaf is a voxel.
  for (auto leaf = tree->begin_leafs_bbx(from, to), end = tree->end_leafs_bbx(); leaf != end; ++leaf) {
    out.setNodeValue(leaf.getKey(), leaf->getLogOdds(), /*lazy_eval=*/true);
  }
  out.updateInnerOccupancy();
  write_tree(out, args[1]);
}

void run(std::vector<std::string> args) {
  const int runs = apgm::bench::take_runs(args);
  const std::string box = apgm::samples::take_option(args, "--bbox");
  const std::string verb = args.empty() ? "" : args[0];
  if (!args.empty()) args.erase(args.begin());
  apgm::samples::expect_arguments(args, verb == "read" ? 1 : 2);
  if (verb == "read") return read(args, runs);
  if (verb == "write") return write(args, runs);
  if (verb == "crop") return crop(args, parse_box(box));
  throw UsageError{"'" + verb + "' is not read, write or crop"};
}

}  // namespace

int main(int argc, char** argv) {
  return apgm::samples::run_program("octomap-peer", kUsage, argc, argv, run);
}

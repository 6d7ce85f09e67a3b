// OpenVDB's making, reading, writing and cropping of the same cells: one grid a mass, one layer of voxels.

#include <openvdb/openvdb.h>
#include <unistd.h>

#include <array>
#include <string>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/format/reader.hpp"
#include "peer.hpp"
#include "samples/support/program.hpp"

namespace {

using apgm::Error;
using apgm::ErrorCode;
using apgm::bench::parse_box;
using apgm::bench::seconds_of;
using apgm::samples::UsageError;

constexpr const char* kUsage =
    "usage: vdb-peer make FILE.apgm OUT.vdb [--compress blosc|zip]\n"
    "       vdb-peer read FILE.vdb [--runs N]\n"
    "       vdb-peer write FILE.vdb OUT.vdb [--runs N] [--compress blosc|zip]\n"
    "       vdb-peer crop FILE.vdb OUT.vdb --bbox XMIN,YMIN,XMAX,YMAX\n"
    "\n"
    "read and write print the seconds of each run. The box is in metres from the datum.\n";

std::uint32_t flags_of(const std::string& compress) {
  if (compress == "zip") return openvdb::io::COMPRESS_ZIP | openvdb::io::COMPRESS_ACTIVE_MASK;
  if (compress.empty() || compress == "blosc") {
    return openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK;
  }
  throw UsageError{"'" + compress + "' is not blosc or zip"};
}

void write_grids(const openvdb::GridCPtrVec& grids, const std::string& path, const std::string& compress) {
  openvdb::io::File file(path);
  file.setCompression(flags_of(compress));
  file.write(grids);
  file.close();
}

/// All of the file: without delay, so that the values are there.
openvdb::GridPtrVec read_grids(const std::string& path) {
  openvdb::io::File file(path);
  file.open(/*delayLoad=*/false);
  return *file.getGrids();
}

void make(const std::string& input, const std::string& output, const std::string& compress) {
  const apgm::Reader reader(input);
  const apgm::LayerType& type = reader.header().types[0];
  std::vector<openvdb::FloatGrid::Ptr> grids;
  for (const std::string& channel : type.channels) {
    grids.push_back(openvdb::FloatGrid::create(0.0f));
    grids.back()->setName(channel);
  }
  apgm::PatchInfo patch;
  apgm::Layer layer;
  for (const auto cursor = reader.patches(); cursor->next(patch);) {
    reader.load(patch.layers[0], layer);
    for (std::size_t c = 0; c < grids.size(); ++c) {
      grids[c]->setTransform(
          openvdb::math::Transform::createLinearTransform(reader.header().frame.cell_m(layer.step())));
      auto accessor = grids[c]->getAccessor();
      const auto plane = layer.plane(static_cast<int>(c));
      for (int k = 0; k < static_cast<int>(plane.size()); ++k) {
        const float v = plane[static_cast<std::size_t>(k)];
        if (v == 0) continue;
        accessor.setValue(openvdb::Coord(patch.patch.x * layer.side() + k % layer.side(),
                                         patch.patch.y * layer.side() + k / layer.side(), 0),
                          v);
      }
    }
  }
  write_grids(openvdb::GridCPtrVec(grids.begin(), grids.end()), output, compress);
}

void read(const std::string& path, int runs) {
  std::vector<double> seconds;
  for (int i = 0; i <= runs; ++i) {
    openvdb::GridPtrVec grids;  // freed outside of the time
    const double s = seconds_of([&] { grids = read_grids(path); });
    if (i > 0) seconds.push_back(s);
  }
  apgm::bench::print_timings("read", seconds);
}

void write(const std::string& path, const std::string& output, const std::string& compress, int runs) {
  const openvdb::GridPtrVec grids = read_grids(path);
  const openvdb::GridCPtrVec all(grids.begin(), grids.end());
  std::vector<double> seconds;
  for (int i = 0; i <= runs; ++i) {
    ::unlink(output.c_str());
    const double s = seconds_of([&] { write_grids(all, output, compress); });
    if (i > 0) seconds.push_back(s);
  }
  apgm::bench::print_timings("write", seconds);
}

/// By OpenVDB's own way to read a part of a grid.
void crop(const std::string& path, const std::string& output, const std::array<double, 4>& box) {
  const auto [left, low, right, high] = box;
  const openvdb::BBoxd bounds({left, low, -0.04}, {right, high, 0.04});
  openvdb::io::File file(path);
  file.open();
  openvdb::GridCPtrVec parts;
  for (auto name = file.beginName(); name != file.endName(); ++name) {
    parts.push_back(file.readGrid(name.gridName(), bounds));
  }
  write_grids(parts, output, "");
}

void run(std::vector<std::string> args) {
  openvdb::initialize();
  const int runs = apgm::bench::take_runs(args);
  const std::string compress = apgm::samples::take_option(args, "--compress");
  const std::string box = apgm::samples::take_option(args, "--bbox");
  const std::string verb = args.empty() ? "" : args[0];
  if (!args.empty()) args.erase(args.begin());
  apgm::samples::expect_arguments(args, verb == "read" ? 1 : 2);
  if (verb == "make") return make(args[0], args[1], compress);
  if (verb == "read") return read(args[0], runs);
  if (verb == "write") return write(args[0], args[1], compress, runs);
  if (verb == "crop") return crop(args[0], args[1], parse_box(box));
  throw UsageError{"'" + verb + "' is not make, read, write or crop"};
}

}  // namespace

int main(int argc, char** argv) { return apgm::samples::run_program("vdb-peer", kUsage, argc, argv, run); }

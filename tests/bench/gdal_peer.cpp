// GDAL's reading and writing of a GeoTIFF in one process and on one core: whole blocks, past the block cache,
// which is the fastest it offers.

#include <cpl_conv.h>
#include <cpl_string.h>
#include <gdal_priv.h>
#include <unistd.h>

#include <cmath>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "apgm/core/error.hpp"
#include "peer.hpp"
#include "samples/support/program.hpp"

namespace {

using apgm::Error;
using apgm::ErrorCode;
using apgm::samples::UsageError;

constexpr const char* kUsage =
    "usage: gdal-peer read FILE.tif [--runs N]\n"
    "       gdal-peer write FILE.tif OUT.tif [--runs N] [--unknown 0] [--co KEY=VALUE]...\n"
    "\n"
    "Prints the seconds of each run. write makes tiles of the size FILE has; --unknown 0 puts 0 in place of "
    "NaN.\n";

struct Close {
  void operator()(GDALDataset* dataset) const { GDALClose(dataset); }
};
using Dataset = std::unique_ptr<GDALDataset, Close>;

void check(bool done, const std::string& what) {
  if (!done) throw Error(ErrorCode::kUnreadable, what + ": " + CPLGetLastErrorMsg());
}

Dataset open(const std::string& path) {
  Dataset dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY));
  check(dataset != nullptr, "cannot open '" + path + "'");
  check(dataset->GetRasterBand(1)->GetRasterDataType() == GDT_Float32, "'" + path + "' is not float32");
  return dataset;
}

/// Goes over all blocks of all bands; block k of the file starts at k * values of a block.
template <typename Do>
void each_block(GDALDataset& dataset, Do&& work) {
  int width = 0, height = 0;
  dataset.GetRasterBand(1)->GetBlockSize(&width, &height);
  const int columns = (dataset.GetRasterXSize() + width - 1) / width;
  const int rows = (dataset.GetRasterYSize() + height - 1) / height;
  std::size_t at = 0;
  for (int band = 1; band <= dataset.GetRasterCount(); ++band) {
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < columns; ++x) {
        work(*dataset.GetRasterBand(band), x, y, at);
        at += static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
      }
    }
  }
}

std::size_t values_of(GDALDataset& dataset) {
  int width = 0, height = 0;
  dataset.GetRasterBand(1)->GetBlockSize(&width, &height);
  std::size_t blocks = 0;
  each_block(dataset, [&](GDALRasterBand&, int, int, std::size_t) { ++blocks; });
  return blocks * static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

void read_blocks(const std::string& path, std::vector<float>& values) {
  const Dataset dataset = open(path);
  each_block(*dataset, [&](GDALRasterBand& band, int x, int y, std::size_t at) {
    check(band.ReadBlock(x, y, &values[at]) == CE_None, "cannot read '" + path + "'");
  });
}

void write_blocks(GDALDataset& like, std::vector<float>& values, const std::string& output,
                  const CPLStringList& options) {
  GDALDriver* driver = GetGDALDriverManager()->GetDriverByName("GTiff");
  check(driver != nullptr, "no GeoTIFF driver");
  Dataset dataset(driver->Create(output.c_str(), like.GetRasterXSize(), like.GetRasterYSize(),
                                 like.GetRasterCount(), GDT_Float32, options.List()));
  check(dataset != nullptr, "cannot create '" + output + "'");
  double transform[6];
  check(like.GetGeoTransform(transform) == CE_None, "no coordinates");
  dataset->SetGeoTransform(transform);
  dataset->SetSpatialRef(like.GetSpatialRef());
  int has = 0;
  const double no_data = like.GetRasterBand(1)->GetNoDataValue(&has);
  if (has != 0) dataset->GetRasterBand(1)->SetNoDataValue(no_data);
  each_block(*dataset, [&](GDALRasterBand& band, int x, int y, std::size_t at) {
    check(band.WriteBlock(x, y, &values[at]) == CE_None, "cannot write '" + output + "'");
  });
  dataset->FlushCache();
}

void read(const std::string& path, int runs) {
  std::vector<float> values(values_of(*open(path)));
  apgm::bench::time_runs("read", runs, [&] { read_blocks(path, values); });
}

void write(const std::string& path, const std::string& output, bool zero, CPLStringList options, int runs) {
  const Dataset like = open(path);
  std::vector<float> values(values_of(*like));
  read_blocks(path, values);
  if (zero) {
    for (float& v : values) v = std::isnan(v) ? 0.0f : v;
    for (int b = 1; b <= like->GetRasterCount(); ++b) like->GetRasterBand(b)->DeleteNoDataValue();
  }
  int width = 0, height = 0;
  like->GetRasterBand(1)->GetBlockSize(&width, &height);
  options.SetNameValue("TILED", "YES");
  options.SetNameValue("BLOCKXSIZE", std::to_string(width).c_str());
  options.SetNameValue("BLOCKYSIZE", std::to_string(height).c_str());
  options.SetNameValue("INTERLEAVE", "BAND");
  std::vector<double> seconds;
  for (int i = 0; i <= runs; ++i) {
    ::unlink(output.c_str());
    const double s = apgm::bench::seconds_of([&] { write_blocks(*like, values, output, options); });
    if (i > 0) seconds.push_back(s);
  }
  apgm::bench::print_timings("write", seconds);
}

void run(std::vector<std::string> args) {
  CPLSetConfigOption("GDAL_NUM_THREADS", "1");
  CPLSetConfigOption("GDAL_PAM_ENABLED", "NO");  // no file beside the input
  GDALAllRegister();
  const int runs = apgm::bench::take_runs(args);
  const bool zero = apgm::samples::take_option(args, "--unknown") == "0";
  CPLStringList options;
  for (std::string o; !(o = apgm::samples::take_option(args, "--co")).empty();) options.AddString(o.c_str());
  const std::string verb = args.empty() ? "" : args[0];
  if (!args.empty()) args.erase(args.begin());
  apgm::samples::expect_arguments(args, verb == "read" ? 1 : 2);
  if (verb == "read") return read(args[0], runs);
  if (verb == "write") return write(args[0], args[1], zero, options, runs);
  throw UsageError{"'" + verb + "' is not read or write"};
}

}  // namespace

int main(int argc, char** argv) { return apgm::samples::run_program("gdal-peer", kUsage, argc, argv, run); }

#include "converters/geotiff/tiff_file.hpp"

#include <cpl_conv.h>
#include <fcntl.h>
#include <gdal.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <limits>

namespace apgm::converters {
namespace {

/// GDAL writes what a GeoTIFF cannot hold into a file beside it, which here would have no name to be beside.
class NoSideFiles {
 public:
  NoSideFiles() { CPLSetThreadLocalConfigOption("GDAL_PAM_ENABLED", "NO"); }
  ~NoSideFiles() { CPLSetThreadLocalConfigOption("GDAL_PAM_ENABLED", nullptr); }
  NoSideFiles(const NoSideFiles&) = delete;
  NoSideFiles& operator=(const NoSideFiles&) = delete;
};

TextList options_of(const TiffLayout& layout) {
  const std::string tile = std::to_string(layout.tile);
  std::vector<std::string> options{
      "TILED=YES",       "BLOCKXSIZE=" + tile, "BLOCKYSIZE=" + tile, "SPARSE_OK=TRUE",
      "INTERLEAVE=BAND", "BIGTIFF=IF_SAFER",   "NUM_THREADS=1",      "ALPHA=NO"};
  options.emplace_back(layout.colours.empty() ? "PHOTOMETRIC=MINISBLACK" : "PHOTOMETRIC=PALETTE");
  const std::string level = std::to_string(layout.level);
  switch (layout.compression) {
    case TiffCompression::kNone:
      options.emplace_back("COMPRESS=NONE");
      return TextList(std::move(options));
    case TiffCompression::kDeflate:
      options.insert(options.end(), {"COMPRESS=DEFLATE", "ZLEVEL=" + level});
      break;
    case TiffCompression::kZstd:
      options.insert(options.end(), {"COMPRESS=ZSTD", "ZSTD_LEVEL=" + level});
      break;
  }
  if (!layout.bytes) options.emplace_back("PREDICTOR=3");
  return TextList(std::move(options));
}

void describe(void* dataset, const TiffLayout& layout) {
  std::array<double, 6> transform{layout.left_m, layout.pixel_m, 0, layout.top_m, 0, -layout.pixel_m};
  GDALSetGeoTransform(dataset, transform.data());
  for (const auto& [key, value] : layout.items) {
    GDALSetMetadataItem(dataset, key.c_str(), value.c_str(), "APGM");
  }
  for (std::size_t i = 0; i < layout.bands.size(); ++i) {
    const GDALRasterBandH band = GDALGetRasterBand(dataset, static_cast<int>(i) + 1);
    GDALSetDescription(band, layout.bands[i].c_str());
    GDALSetRasterNoDataValue(band, layout.bytes ? 0 : std::numeric_limits<double>::quiet_NaN());
  }
  if (layout.colours.empty()) return;
  const GDALColorTableH table = GDALCreateColorTable(GPI_RGB);
  for (std::size_t i = 0; i < layout.colours.size(); ++i) {
    const TiffColour& c = layout.colours[i];
    const GDALColorEntry entry{c.red, c.green, c.blue, c.alpha};
    GDALSetColorEntry(table, static_cast<int>(i), &entry);
  }
  GDALSetRasterColorTable(GDALGetRasterBand(dataset, 1), table);
  GDALDestroyColorTable(table);
}

}  // namespace

TiffFile::Unnamed::Unnamed(const std::string& beside) {
  std::string directory = std::filesystem::path(beside).parent_path().string();
  if (directory.empty()) directory = ".";
  fd = ::open(directory.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (fd < 0 && (errno == EOPNOTSUPP || errno == EISDIR || errno == EINVAL)) {
    std::string name = directory + "/.apgm-XXXXXX";
    fd = ::mkostemp(name.data(), O_CLOEXEC);
    if (fd >= 0) ::unlink(name.c_str());
  }
  if (fd >= 0) return;
  throw Error(ErrorCode::kOutput, "cannot write '" + beside + "': " + std::strerror(errno)).at(beside);
}

TiffFile::Unnamed::~Unnamed() { ::close(fd); }

TiffFile::TiffFile(const std::string& beside, const TiffLayout& layout, const Frame& frame,
                   const Findings& findings, std::uint64_t max_memory_bytes)
    : beside_(beside), cache_(max_memory_bytes), file_(beside) {
  const GdalErrors errors;
  const NoSideFiles no_side_files;
  TextList options = options_of(layout);
  // Through /proc the file can be opened again without a name.
  const std::string path = "/proc/self/fd/" + std::to_string(file_.fd);
  dataset_ = Dataset(GDALCreate(GDALGetDriverByName("GTiff"), path.c_str(), static_cast<int>(layout.width),
                                static_cast<int>(layout.height), static_cast<int>(layout.bands.size()),
                                layout.bytes ? GDT_Byte : GDT_Float32, options.get()));
  if (dataset_) {
    set_crs(dataset_.get(), frame, findings);
    describe(dataset_.get(), layout);
  }
  if (!dataset_ || errors.failed()) fail(errors);
}

TiffFile::~TiffFile() {
  const NoSideFiles no_side_files;
  dataset_.reset();
}

void TiffFile::fail(const GdalErrors& errors) const {
  throw Error(ErrorCode::kOutput,
              "cannot write '" + beside_ + "': " + (errors.failed() ? errors.text() : "GDAL gives no reason"))
      .hint(dataset_ ? "free some space or choose another place; nothing was written"
                     : "if GDAL has no ZSTD here, --set compression=deflate does without")
      .at(beside_);
}

void TiffFile::write(int band, std::int64_t column, std::int64_t row, void* values) {
  const GdalErrors errors;
  const CPLErr result = GDALWriteBlock(GDALGetRasterBand(dataset_.get(), band + 1), static_cast<int>(column),
                                       static_cast<int>(row), values);
  if (result != CE_None || errors.failed()) fail(errors);
}

void TiffFile::copy_to(OutputFile& file) {
  {
    const GdalErrors errors;
    const NoSideFiles no_side_files;
    // Flushed before it is closed, so that what fails at the end is seen.
    GDALFlushCache(dataset_.get());
    if (errors.failed()) fail(errors);
    GDALClose(dataset_.release());
    if (errors.failed()) fail(errors);
  }
  std::vector<std::byte> buffer(std::size_t{1} << 20);
  for (off_t at = 0;;) {
    const ssize_t got = ::pread(file_.fd, buffer.data(), buffer.size(), at);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      throw Error(ErrorCode::kOutput, "cannot write '" + beside_ + "': " + std::strerror(errno)).at(beside_);
    }
    if (got == 0) return;
    file.write(std::span(buffer).first(static_cast<std::size_t>(got)));
    at += got;
  }
}

}  // namespace apgm::converters

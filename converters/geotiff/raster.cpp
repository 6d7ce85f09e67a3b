#include "converters/geotiff/raster.hpp"

#include <cpl_string.h>
#include <gdal.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>

#include "converters/common/file.hpp"
#include "converters/common/settings.hpp"

namespace apgm::converters {
namespace {

constexpr std::array<const char*, 6> kDrivers{"GTiff", "AAIGrid", "HFA", "EHdr", "ENVI", nullptr};
constexpr int kMostBands = 1024;
constexpr std::int64_t kMostBlockBytes = std::int64_t{256} << 20;
constexpr std::int64_t kMostValues = std::int64_t{1} << 34;
constexpr int kMostCategories = 65536;

Dataset open_dataset(const std::string& path) {
  register_drivers();
  return Dataset(
      GDALOpenEx(path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY, kDrivers.data(), nullptr, nullptr));
}

void check_file(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  // GDAL takes some names for more than files.
  if (fs::is_regular_file(path, ignored)) return;
  const bool there = fs::exists(path, ignored);
  throw Error(ErrorCode::kUnreadable,
              "cannot read '" + path + "': " + (there ? "not a regular file" : "no such file"))
      .hint(there ? "" : "check the name and the directory")
      .at(path);
}

std::string text_of(const char* text) { return text == nullptr ? "" : text; }

/// Names of values from an attribute table, where it has a column of values and one of names.
std::map<std::int64_t, std::string> names_from_table(GDALRasterAttributeTableH table) {
  std::map<std::int64_t, std::string> names;
  if (table == nullptr) return names;
  int value = GDALRATGetColOfUsage(table, GFU_MinMax);
  if (value < 0) value = GDALRATGetColOfUsage(table, GFU_Min);
  const int name = GDALRATGetColOfUsage(table, GFU_Name);
  if (name < 0) return names;
  const int rows = std::min(GDALRATGetRowCount(table), kMostCategories);
  for (int row = 0; row < rows; ++row) {
    const std::string text = text_of(GDALRATGetValueAsString(table, row, name));
    if (!text.empty()) names[value < 0 ? row : GDALRATGetValueAsInt(table, row, value)] = text;
  }
  return names;
}

std::map<std::int64_t, std::string> categories_of(GDALRasterBandH band) {
  std::map<std::int64_t, std::string> names;
  char** list = GDALGetRasterCategoryNames(band);
  for (int i = 0; list != nullptr && list[i] != nullptr && i < kMostCategories; ++i) {
    if (list[i][0] != '\0') names[i] = list[i];
  }
  return names.empty() ? names_from_table(GDALGetDefaultRAT(band)) : names;
}

}  // namespace

Raster::Raster(const std::string& path, std::uint64_t max_memory_bytes)
    : path_(path), max_memory_bytes_(max_memory_bytes), cache_(max_memory_bytes) {
  check_file(path);
  open();
  const GdalErrors unseen;
  width_ = GDALGetRasterXSize(dataset_.get());
  height_ = GDALGetRasterYSize(dataset_.get());
  const int count = GDALGetRasterCount(dataset_.get());
  if (count < 1) throw Error(ErrorCode::kUnsupported, "'" + path + "' has no bands").at(path);
  if (count > kMostBands || width_ > kMostValues / height_ / count) {
    throw Error(ErrorCode::kLimit, "'" + path + "' has " + std::to_string(width_) + " x " +
                                       std::to_string(height_) + " pixels in " + std::to_string(count) +
                                       " bands, more than 2^34 values or 1024 bands")
        .hint("cut it with gdal_translate -srcwin or -b")
        .at(path);
  }
  take_geometry();
  crs_ = crs_of(dataset_.get());
  for (int i = 1; i <= count; ++i) take_band(i);
  char** items = GDALGetMetadata(dataset_.get(), "APGM");
  for (int i = 0; items != nullptr && items[i] != nullptr; ++i) {
    const std::string item = items[i];
    const std::size_t equals = item.find('=');
    if (equals != std::string::npos) tags_[item.substr(0, equals)] = item.substr(equals + 1);
  }
}

void Raster::open() {
  const GdalErrors errors;
  dataset_ = open_dataset(path_);
  if (dataset_) return;
  throw Error(ErrorCode::kForeign, "'" + path_ + "' is no raster this converter reads" +
                                       (errors.failed() ? ": " + errors.text() : std::string()))
      .hint("it reads GeoTIFF, ESRI ASCII grid and BIL, ERDAS Imagine and ENVI; gdal_translate makes them")
      .at(path_);
}

void Raster::take_geometry() {
  std::array<double, 6> g{};
  if (GDALGetGeoTransform(dataset_.get(), g.data()) != CE_None) {
    throw Error(ErrorCode::kUnsupported, "'" + path_ + "' does not say where it lies")
        .hint("gdal_edit.py -a_ullr gives it coordinates; control points need gdalwarp")
        .at(path_);
  }
  const bool finite = std::ranges::all_of(g, [](double v) { return std::isfinite(v); });
  if (!finite || g[2] != 0 || g[4] != 0 || !(g[1] > 0) || g[5] == 0) {
    throw Error(ErrorCode::kUnsupported, "the axes of '" + path_ + "' are turned, sheared or mirrored")
        .hint("gdalwarp makes a raster whose rows run west to east")
        .at(path_);
  }
  south_up_ = g[5] > 0;
  pixel_x_m_ = g[1];
  pixel_y_m_ = std::fabs(g[5]);
  corner_m_ = {g[0], south_up_ ? g[3] : g[3] + static_cast<double>(height_) * g[5]};
}

void Raster::take_band(int number) {
  const GDALRasterBandH handle = GDALGetRasterBand(dataset_.get(), number);
  const GDALDataType type = GDALGetRasterDataType(handle);
  const auto refuse = [&](ErrorCode code, const std::string& what, const char* hint) {
    throw Error(code, "band " + std::to_string(number) + " of '" + path_ + "' " + what).hint(hint).at(path_);
  };
  if (GDALDataTypeIsComplex(type) != 0 || type == GDT_Int64 || type == GDT_UInt64 || type == GDT_Unknown) {
    refuse(ErrorCode::kUnsupported, "holds " + text_of(GDALGetDataTypeName(type)) + " values",
           "gdal_translate -ot Float32 or Int32 makes a raster that can be read");
  }
  int block_x = 0, block_y = 0;
  GDALGetBlockSize(handle, &block_x, &block_y);
  const std::int64_t bytes = GDALGetDataTypeSizeBytes(type);
  if (block_x < 1 || block_y < 1 || block_x > kMostBlockBytes / bytes / block_y) {
    refuse(ErrorCode::kLimit,
           "has blocks of " + std::to_string(block_x) + " x " + std::to_string(block_y) +
               " pixels, more than 256 MiB",
           "gdal_translate -co TILED=YES makes smaller ones");
  }
  check_block(number, bytes * block_x * block_y);
  pixel_bytes_ += bytes;
  block_rows_ = std::max<std::int64_t>(block_rows_, block_y);
  block_columns_ = std::max<std::int64_t>(block_columns_, block_x);
  RasterBand band;
  band.description = text_of(GDALGetDescription(handle));
  band.integer = GDALDataTypeIsInteger(type) != 0;
  band.single = type == GDT_Float32;
  int has = 0;
  const double no_data = GDALGetRasterNoDataValue(handle, &has);
  if (has != 0) band.no_data = band.single ? static_cast<double>(static_cast<float>(no_data)) : no_data;
  const double scale = GDALGetRasterScale(handle, &has), offset = GDALGetRasterOffset(handle, nullptr);
  if (std::isfinite(scale) && scale != 0) band.scale = scale;
  if (std::isfinite(offset)) band.offset = offset;
  if (band.integer) band.categories = categories_of(handle);
  bands_.push_back(std::move(band));
}

void Raster::check_block(int number, std::int64_t bytes) const {
  if (max_memory_bytes_ == 0) return;
  const char* interleave = GDALGetMetadataItem(dataset_.get(), "INTERLEAVE", "IMAGE_STRUCTURE");
  const int bands = GDALGetRasterCount(dataset_.get());
  // One block of all bands is decoded as a whole where their pixels lie together.
  const int together = text_of(interleave) == "PIXEL" ? bands : 1;
  constexpr std::uint64_t kCopies = 3;  // as stored, decoded, in the cache
  const std::uint64_t need =
      kCopies * static_cast<std::uint64_t>(bytes) * static_cast<std::uint64_t>(together);
  check_budget(max_memory_bytes_, need,
               "a block of band " + std::to_string(number) + " of '" + path_ + "' is decoded as a whole",
               "make smaller blocks with gdal_translate -co TILED=YES");
}

std::int64_t Raster::rows_at_a_time(std::int64_t columns, std::size_t bands, double share) const {
  constexpr std::int64_t kMostRows = 256;
  if (max_memory_bytes_ == 0) return kMostRows;
  const double bytes = share * static_cast<double>(max_memory_bytes_);
  const double row = static_cast<double>(columns) * static_cast<double>(bands * sizeof(double));
  // Fewer than a block has would decode each block several times.
  const std::int64_t cached = std::max(block_rows_, cache_.bytes() / (width_ * pixel_bytes_));
  const double rows = std::min(bytes / std::max(row, 1.0), static_cast<double>(std::min(cached, kMostRows)));
  return std::max<std::int64_t>(static_cast<std::int64_t>(rows), 1);
}

std::int64_t Raster::columns_at_a_time(std::int64_t most) const {
  if (max_memory_bytes_ == 0) return most;
  // A window that is not on blocks touches one more.
  const std::int64_t cached = cache_.bytes() / (block_rows_ * pixel_bytes_) - block_columns_;
  return std::min(std::max({cached, block_columns_, std::int64_t{1}}), std::max(most, block_columns_));
}

std::int64_t Raster::first_row(const Window& window) const {
  return south_up_ ? window.y : height_ - window.y - window.height;
}

bool Raster::is_absent(const Window& window) const {
  const std::scoped_lock lock(mutex_);
  const GdalErrors unseen;
  for (std::size_t i = 0; i < bands_.size(); ++i) {
    if (!bands_[i].no_data) return false;
    const int status = GDALGetDataCoverageStatus(
        GDALGetRasterBand(dataset_.get(), static_cast<int>(i) + 1), static_cast<int>(window.x),
        static_cast<int>(first_row(window)), static_cast<int>(window.width), static_cast<int>(window.height),
        0, nullptr);
    if (status != GDAL_DATA_COVERAGE_STATUS_EMPTY) return false;
  }
  return true;
}

void Raster::read(int band, const Window& window, std::span<double> out) const {
  const std::size_t count = static_cast<std::size_t>(window.width * window.height);
  if (count == 0) return;
  const auto line = static_cast<GSpacing>(window.width) * static_cast<GSpacing>(sizeof(double));
  // The file's rows mostly come from the north: then the last row in memory is filled first.
  double* first = south_up_ ? out.data() : out.data() + (window.height - 1) * window.width;
  {
    const std::scoped_lock lock(mutex_);
    const GdalErrors errors;
    const CPLErr result = GDALRasterIOEx(
        GDALGetRasterBand(dataset_.get(), band + 1), GF_Read, static_cast<int>(window.x),
        static_cast<int>(first_row(window)), static_cast<int>(window.width), static_cast<int>(window.height),
        first, static_cast<int>(window.width), static_cast<int>(window.height), GDT_Float64, sizeof(double),
        south_up_ ? line : -line, nullptr);
    if (result != CE_None || errors.failed()) {
      throw Error(ErrorCode::kDamaged, "band " + std::to_string(band + 1) + " of '" + path_ +
                                           "' cannot be decoded near " + place(window.x, window.y) +
                                           (errors.failed() ? ": " + errors.text() : std::string()))
          .hint("the file is damaged or was cut short; 'gdalinfo -checksum' shows what can be read")
          .at(path_);
    }
  }
  const RasterBand& about = bands_[static_cast<std::size_t>(band)];
  for (double& v : out.first(count)) {
    if (about.no_data && v == *about.no_data) v = std::numeric_limits<double>::quiet_NaN();
    if (about.scale != 1 || about.offset != 0) v = v * about.scale + about.offset;
  }
}

std::string Raster::place(std::int64_t x, std::int64_t y) const {
  return "column " + std::to_string(x) + ", row " + std::to_string(south_up_ ? y : height_ - 1 - y);
}

std::vector<std::string> files_of_raster(const std::string& path) {
  std::vector<std::string> files{path};
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return files;
  const GdalErrors unseen;
  const Dataset dataset = open_dataset(path);
  if (!dataset) return files;
  char** list = GDALGetFileList(dataset.get());
  for (int i = 0; list != nullptr && list[i] != nullptr; ++i) {
    if (path != list[i]) files.emplace_back(list[i]);
  }
  CSLDestroy(list);
  return files;
}

}  // namespace apgm::converters

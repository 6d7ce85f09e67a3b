#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "converters/geotiff/crs.hpp"
#include "converters/geotiff/gdal.hpp"

namespace apgm::converters {

/// One band of a raster, before any pixel is read.
struct RasterBand {
  std::string description;
  bool integer = false;                            ///< a type of whole numbers
  bool single = false;                             ///< float32
  std::optional<double> no_data;                   ///< the value that stands for no data, beside NaN
  double scale = 1, offset = 0;                    ///< value = stored * scale + offset
  std::map<std::int64_t, std::string> categories;  ///< names of values: category names or attribute table
};

/// A window of pixels; rows count from the south.
struct Window {
  std::int64_t x = 0, y = 0;
  std::int64_t width = 0, height = 0;
};

/// A raster that GDAL reads: a regular file of one of the drivers of register_drivers, north up or south up,
/// not turned. Nothing that its headers say is believed before it is checked.
///
/// Thread rule: const members from any thread; reads take turns.
class Raster {
 public:
  /// @throws Error{kUnreadable} if the file cannot be opened, {kForeign} if it is no such raster, {kLimit} on
  ///         sizes beyond 2^31 pixels a side, 2^34 values or blocks of 256 MiB, {kUnsupported} on complex or
  ///         64-bit integer values, a turned raster or one without coordinates
  /// @param max_memory_bytes  bound of GDAL's cache and of the pixels read at a time; {kLimit} where blocks
  /// do
  ///         not fit. 0: 64 MiB of cache
  explicit Raster(const std::string& path, std::uint64_t max_memory_bytes = 0);

  const std::string& path() const { return path_; }
  std::int64_t width() const { return width_; }
  std::int64_t height() const { return height_; }
  const std::vector<RasterBand>& bands() const { return bands_; }
  const RasterCrs& crs() const { return crs_; }
  /// Items of the metadata domain "APGM".
  const std::map<std::string, std::string>& tags() const { return tags_; }
  double pixel_x_m() const { return pixel_x_m_; }
  double pixel_y_m() const { return pixel_y_m_; }
  /// South-west corner.
  Point corner_m() const { return corner_m_; }

  /// Rows of a window of that many columns and bands that fit `share` of the budget and that GDAL's cache
  /// holds over the raster's whole width: from 1 to 256.
  std::int64_t rows_at_a_time(std::int64_t columns, std::size_t bands, double share) const;

  /// Columns of a window whose blocks GDAL's cache holds in one row of them: up to `most`, or
  /// the columns of a block; `most` without a budget.
  std::int64_t columns_at_a_time(std::int64_t most) const;
  /// Rows of the highest blocks.
  std::int64_t block_rows() const { return block_rows_; }

  /// True if the file holds no pixel of the window in any band, and says that this means no data.
  bool is_absent(const Window& window) const;
  /// Values of a band (from 0), the southern row first; NaN where there is no data; scaled.
  /// @throws Error{kDamaged} if GDAL cannot decode them
  void read(int band, const Window& window, std::span<double> out) const;
  /// "column 3, row 7" of a pixel, as GDAL and GIS count: row 0 is the file's first.
  std::string place(std::int64_t x, std::int64_t y) const;

 private:
  void open();
  void take_geometry();
  void take_band(int number);
  /// @throws Error{kLimit} if blocks of so many bytes do not fit the budget
  void check_block(int number, std::int64_t bytes) const;
  std::int64_t first_row(const Window& window) const;

  std::string path_;
  std::uint64_t max_memory_bytes_;
  CacheShare cache_;
  mutable std::mutex mutex_;
  Dataset dataset_;
  std::int64_t width_ = 0, height_ = 0;
  std::int64_t pixel_bytes_ = 0;  // over all bands, in the cache
  std::int64_t block_rows_ = 1;   // of the highest blocks
  std::int64_t block_columns_ = 1;
  std::vector<RasterBand> bands_;
  RasterCrs crs_;
  std::map<std::string, std::string> tags_;
  double pixel_x_m_ = 0, pixel_y_m_ = 0;
  Point corner_m_;
  bool south_up_ = false;
};

/// The files a raster is made of, the path first; only the path if that cannot be told.
std::vector<std::string> files_of_raster(const std::string& path);

}  // namespace apgm::converters

#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "apgm/format/output_file.hpp"
#include "converters/geotiff/crs.hpp"
#include "converters/geotiff/gdal.hpp"

namespace apgm::converters {

enum class TiffCompression : std::uint8_t { kNone, kDeflate, kZstd };

struct TiffColour {
  std::uint8_t red = 0, green = 0, blue = 0, alpha = 255;
};

/// What a GeoTIFF is, before its pixels.
struct TiffLayout {
  std::int64_t width = 0, height = 0;
  int tile = 128;      ///< side of a tile, a multiple of 16
  bool bytes = false;  ///< uint8, no data 0; else float32, no data NaN
  double left_m = 0, top_m = 0, pixel_m = 0;
  std::vector<std::string> bands;            ///< descriptions
  std::vector<TiffColour> colours;           ///< of the values from 0; empty: grey
  std::map<std::string, std::string> items;  ///< of metadata domain "APGM"
  TiffCompression compression = TiffCompression::kZstd;
  int level = 3;
};

/// A GeoTIFF that GDAL writes tile by tile into a file without a name, and that is then copied into an
/// OutputFile: GDAL goes back and forth in its file, and an OutputFile only appends. Tiles that are never
/// written take no space and hold no data. Same calls, same bytes.
class TiffFile {
 public:
  /// @param beside  the file without a name lies in this path's directory
  /// @throws Error{kOutput} if it cannot be made, {kUnsupported} if GDAL lacks the compression
  /// @param max_memory_bytes  bounds GDAL's cache; 0: 64 MiB
  TiffFile(const std::string& beside, const TiffLayout& layout, const Frame& frame, const Findings& findings,
           std::uint64_t max_memory_bytes = 0);
  ~TiffFile();
  TiffFile(const TiffFile&) = delete;
  TiffFile& operator=(const TiffFile&) = delete;

  /// A whole tile of float32 or uint8, its northern row first. @throws Error{kOutput}
  void write(int band, std::int64_t column, std::int64_t row, void* values);
  /// Ends the raster and appends it to `file`. @throws Error{kOutput}
  void copy_to(OutputFile& file);

 private:
  /// A file that is gone when it is closed.
  struct Unnamed {
    explicit Unnamed(const std::string& beside);
    ~Unnamed();
    Unnamed(const Unnamed&) = delete;
    Unnamed& operator=(const Unnamed&) = delete;
    int fd = -1;
  };
  [[noreturn]] void fail(const GdalErrors& errors) const;

  std::string beside_;
  CacheShare cache_;
  Unnamed file_;
  Dataset dataset_;  // closed before its file
};

}  // namespace apgm::converters

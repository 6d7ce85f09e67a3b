#include <cpl_conv.h>
#include <cpl_error.h>
#include <cpl_vsi.h>
#include <gdal_priv.h>

#include <array>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "random_map.hpp"
#include "readers.hpp"

namespace apgm::test {
namespace {

constexpr int kSide = 128;
constexpr const char* kPath = "/vsimem/reliability.tif";
constexpr std::array<double, 6> kPlace{570000, 0.1, 0, 5360000, 0, -0.1};

/// Two bands of float32 masses in tiles under zstd, as apgm-convert writes them.
std::string make_file() {
  GDALDriver* driver = GetGDALDriverManager()->GetDriverByName("GTiff");
  const char* options[] = {"TILED=YES", "BLOCKXSIZE=64", "BLOCKYSIZE=64", "COMPRESS=ZSTD", nullptr};
  GDALDataset* set = driver->Create(kPath, kSide, kSide, 2, GDT_Float32, const_cast<char**>(options));
  if (set == nullptr) throw std::runtime_error("GDAL cannot write a GeoTIFF under zstd");
  std::array<double, 6> place = kPlace;
  set->SetGeoTransform(place.data());
  Random random(3);
  for (int band = 1; band <= 2; ++band) {
    std::vector<float> values(kSide * kSide);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double wave =
          std::sin(static_cast<double>(i % kSide) / 9) * std::cos(static_cast<double>(i / kSide) / 7);
      values[i] = wave > 0.2 ? static_cast<float>(random.in(64, 250)) / 256 : 0;
    }
    if (set->GetRasterBand(band)->RasterIO(GF_Write, 0, 0, kSide, kSide, values.data(), kSide, kSide,
                                           GDT_Float32, 0, 0) != CE_None) {
      throw std::runtime_error("GDAL cannot write");
    }
  }
  GDALClose(set);
  vsi_l_offset size = 0;
  const GByte* bytes = VSIGetMemFileBuffer(kPath, &size, FALSE);
  std::string file(reinterpret_cast<const char*>(bytes), size);
  VSIUnlink(kPath);
  return file;
}

class GeoTiff final : public Format {
 public:
  GeoTiff() {
    GDALAllRegister();
    CPLSetErrorHandler(CPLQuietErrorHandler);
    file_ = make_file();
    read(file_);
    good_ = last_;
  }
  std::string name() const override { return "GeoTIFF, zstd"; }
  const std::string& file() const override { return file_; }

  Answer read(const std::string& bytes) override {
    last_.clear();
    CPLErrorReset();
    std::string copy = bytes;
    VSIFCloseL(VSIFileFromMemBuffer(kPath, reinterpret_cast<GByte*>(copy.data()), copy.size(), FALSE));
    auto* set = static_cast<GDALDataset*>(GDALOpenEx(kPath, GDAL_OF_RASTER, nullptr, nullptr, nullptr));
    const bool read_all = set != nullptr && take(*set) && CPLGetLastErrorType() < CE_Failure;
    if (set != nullptr) GDALClose(set);
    VSIUnlink(kPath);
    if (!read_all) return Answer::kDetected;
    return last_ == good_ ? Answer::kSame : Answer::kWrong;
  }

 private:
  /// Size, place and all values.
  bool take(GDALDataset& set) {
    std::array<double, 6> place{};
    set.GetGeoTransform(place.data());
    const int width = set.GetRasterXSize(), height = set.GetRasterYSize();
    if (static_cast<double>(width) * height * set.GetRasterCount() > 1e8) return false;
    last_ = std::to_string(width) + "x" + std::to_string(height);
    last_.append(reinterpret_cast<const char*>(place.data()), sizeof(place));
    std::vector<float> values(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    for (int band = 1; band <= set.GetRasterCount(); ++band) {
      if (set.GetRasterBand(band)->RasterIO(GF_Read, 0, 0, width, height, values.data(), width, height,
                                            GDT_Float32, 0, 0) != CE_None) {
        return false;
      }
      last_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
    }
    return true;
  }

  std::string file_, good_, last_;
};

}  // namespace

std::unique_ptr<Format> geotiff_zstd() { return std::make_unique<GeoTiff>(); }

}  // namespace apgm::test

#include "converters/geotiff/gdal.hpp"

#include <cpl_conv.h>
#include <cpl_error.h>
#include <gdal.h>
#include <gdal_frmts.h>

#include <algorithm>
#include <mutex>

#include "converters/common/settings.hpp"

namespace apgm::converters {
namespace {

void CPL_STDCALL collect(CPLErr severity, CPLErrorNum /*number*/, const char* text) {
  if (severity < CE_Failure) return;
  static_cast<GdalErrors*>(CPLGetErrorHandlerUserData())->add(text);
}

}  // namespace

GdalErrors::GdalErrors() { CPLPushErrorHandlerEx(collect, this); }

GdalErrors::~GdalErrors() {
  CPLPopErrorHandler();
  CPLErrorReset();
}

void GdalErrors::add(const char* text) {
  if (!first_.empty()) return;
  std::string line = text == nullptr ? "" : text;
  std::replace(line.begin(), line.end(), '\n', ' ');
  first_ = line.empty() ? "unknown failure" : printable(line);
}

void CloseDataset::operator()(void* dataset) const {
  const GdalErrors unseen;
  GDALClose(dataset);
}

void register_drivers() {
  static std::once_flag once;
  std::call_once(once, [] {
    const GdalErrors unseen;
    GDALRegister_GTiff();
    GDALRegister_AAIGrid();
    GDALRegister_HFA();
    GDALRegister_EHdr();
    GDALRegister_ENVI();
    // GDAL's own bound is a share of the machine's memory.
    constexpr GIntBig kCacheBytes = GIntBig{64} << 20;
    GDALSetCacheMax64(kCacheBytes);
  });
}

TextList::TextList(std::vector<std::string> texts) : texts_(std::move(texts)) {
  for (std::string& text : texts_) pointers_.push_back(text.data());
  pointers_.push_back(nullptr);
}

}  // namespace apgm::converters

#include "converters/geotiff/gdal.hpp"

#include <cpl_conv.h>
#include <cpl_error.h>
#include <gdal.h>
#include <gdal_frmts.h>

#include <algorithm>
#include <mutex>
#include <set>

#include "converters/common/settings.hpp"

namespace apgm::converters {
namespace {

void CPL_STDCALL collect(CPLErr severity, CPLErrorNum /*number*/, const char* text) {
  if (severity < CE_Failure) return;
  static_cast<GdalErrors*>(CPLGetErrorHandlerUserData())->add(text);
}

constexpr std::int64_t kMostCacheBytes = std::int64_t{64} << 20;
constexpr std::int64_t kLeastCacheBytes = std::int64_t{256} << 10;

/// The bounds of all files that are open.
struct CacheShares {
  std::mutex mutex;
  std::multiset<std::int64_t> bounds;

  void apply() const { GDALSetCacheMax64(bounds.empty() ? kMostCacheBytes : *bounds.begin()); }
};

CacheShares& cache_shares() {
  static CacheShares shares;
  return shares;
}

std::int64_t share_of(std::uint64_t max_memory_bytes) {
  if (max_memory_bytes == 0) return kMostCacheBytes;
  const std::uint64_t quarter = std::min<std::uint64_t>(max_memory_bytes / 4, kMostCacheBytes);
  return std::max(static_cast<std::int64_t>(quarter), kLeastCacheBytes);
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

CacheShare::CacheShare(std::uint64_t max_memory_bytes) : bytes_(share_of(max_memory_bytes)) {
  register_drivers();
  CacheShares& shares = cache_shares();
  const std::scoped_lock lock(shares.mutex);
  shares.bounds.insert(bytes_);
  shares.apply();
}

std::uint64_t CacheShare::of(std::uint64_t max_memory_bytes) {
  return static_cast<std::uint64_t>(share_of(max_memory_bytes));
}

CacheShare::~CacheShare() {
  CacheShares& shares = cache_shares();
  const std::scoped_lock lock(shares.mutex);
  shares.bounds.erase(shares.bounds.find(bytes_));
  shares.apply();
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
    GDALSetCacheMax64(kMostCacheBytes);
  });
}

TextList::TextList(std::vector<std::string> texts) : texts_(std::move(texts)) {
  for (std::string& text : texts_) pointers_.push_back(text.data());
  pointers_.push_back(nullptr);
}

}  // namespace apgm::converters

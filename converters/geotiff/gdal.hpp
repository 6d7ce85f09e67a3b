#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "apgm/core/error.hpp"

namespace apgm::converters {

/// Catches what GDAL reports on this thread while it lives: GDAL prints nothing and what failed becomes an
/// Error. Scopes nest; each sees what happened in it.
class GdalErrors {
 public:
  GdalErrors();
  ~GdalErrors();
  GdalErrors(const GdalErrors&) = delete;
  GdalErrors& operator=(const GdalErrors&) = delete;

  bool failed() const { return !first_.empty(); }
  /// The first failure in GDAL's words, fit for a message; empty if there was none.
  const std::string& text() const { return first_; }
  /// For GDAL's callback.
  void add(const char* text);

 private:
  std::string first_;
};

/// Closes a dataset; what GDAL reports meanwhile is not seen.
struct CloseDataset {
  void operator()(void* dataset) const;
};
using Dataset = std::unique_ptr<void, CloseDataset>;

/// Bounds GDAL's cache of blocks, which is one for the whole process, while a file is read or written: by a
/// quarter of a budget, and never more than 64 MiB. Of several at a time the least bound holds.
class CacheShare {
 public:
  /// @param max_memory_bytes  the budget; 0: none
  explicit CacheShare(std::uint64_t max_memory_bytes);
  ~CacheShare();
  CacheShare(const CacheShare&) = delete;
  CacheShare& operator=(const CacheShare&) = delete;

  std::int64_t bytes() const { return bytes_; }
  /// Of a budget.
  static std::uint64_t of(std::uint64_t max_memory_bytes);

 private:
  std::int64_t bytes_;
};

/// Makes the drivers of this converter known to GDAL, and bounds GDAL's cache of blocks; once a process.
/// No other driver is loaded: some follow names in a file to other files or to the network.
void register_drivers();

/// A list as GDAL takes them: pointers into texts that outlive it, ended by a nullptr.
class TextList {
 public:
  explicit TextList(std::vector<std::string> texts);
  char** get() { return pointers_.data(); }

 private:
  std::vector<std::string> texts_;
  std::vector<char*> pointers_;
};

}  // namespace apgm::converters

#pragma once

#include <memory>

#include "converters/scans/byte_stream.hpp"
#include "converters/scans/scan_reader.hpp"

namespace apgm::converters {

/// One input of a ScanReader.
class Recording {
 public:
  virtual ~Recording() = default;
  /// As ScanReader::next, but for the error at the end.
  virtual bool next(Measurement& out) = 0;
  virtual std::uint64_t bytes_done() const = 0;
};

/// The `Kind` in `out`, made there if it holds another: memory of vectors is kept from call to call.
template <class Kind>
Kind& as(Measurement& out) {
  if (!std::holds_alternative<Kind>(out)) out.emplace<Kind>();
  return std::get<Kind>(out);
}

/// Time between scans that bear no time.
inline constexpr std::int64_t kScanInterval_ns = 100'000'000;

}  // namespace apgm::converters

#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/observe/measurement.hpp"

namespace apgm::converters {

using Measurement = std::variant<LaserScan, PointCloud, LabelledGround>;

/// A format of recordings (docs/scans.md).
struct ScanFormat {
  std::string_view name;         ///< "carmen"
  std::string_view description;  ///< one line
};

/// All formats that are read, by name.
std::span<const ScanFormat> scan_formats();

struct ScanRequest {
  /// Logs, clouds and directories of clouds, in the order they were recorded; "-" is standard input. Each may
  /// be packed by bzip2.
  std::vector<std::string> paths;
  std::string poses;   ///< file with the poses of clouds; empty: none
  std::string format;  ///< name of the format of all files; empty: by content, then by extension
  const std::atomic<bool>* cancel = nullptr;  ///< set: reading ends with Error{kCancelled}
};

/// Something wrong with the recordings that did not stop the reading: lines, scans or clouds left out.
struct ScanFault {
  std::string key;          ///< "cut_lines"
  std::uint64_t count = 0;  ///< > 0
  std::string first;        ///< where it was met first: "run.log:120"
  std::string text;         ///< all of it for people: "3 lines were cut short (first: run.log:120)"
};

/// The measurements of recordings, one after the other. Memory does not grow with their number. One thread.
class ScanReader {
 public:
  virtual ~ScanReader() = default;
  /// The next measurement in `out`, whose memory is used again; false at the end. Within a recording and a
  /// sensor stamps do not go back, unless the clock was set back for good (docs/scans.md, times_back).
  /// @throws Error{kUnreadable|kDamaged|kLimit} that names the file and the line or byte; {kDamaged} at the
  ///         end if there was no measurement at all
  virtual bool next(Measurement& out) = 0;
  /// Bytes of all files as they are stored; 0: not known.
  virtual std::uint64_t total_bytes() const = 0;
  virtual std::uint64_t bytes_done() const = 0;
  /// What was left out so far, in a fixed order.
  virtual std::vector<ScanFault> faults() const = 0;
  /// Names of the formats met, sorted.
  virtual std::vector<std::string> formats() const = 0;
  /// All files that are read, those of directories and lists too; none of them may be an output.
  virtual std::vector<std::string> files() const = 0;
};

/// Looks at the head of every file, and reads the poses.
/// @throws Error{kInvalidArgument} on a format that does not exist, poses for what has its own, clouds
///         without poses; {kUnreadable|kForeign|kDamaged|kLimit} on files
std::unique_ptr<ScanReader> open_scans(const ScanRequest& request);

}  // namespace apgm::converters

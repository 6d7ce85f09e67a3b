#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/core/source.hpp"
#include "apgm/format/output_file.hpp"
#include "apgm/ops/run.hpp"

namespace apgm::converters {

/// `--set KEY=VALUE` pairs. A converter refuses a key it does not list.
using Settings = std::map<std::string, std::string>;

struct SettingSpec {
  std::string key;
  std::string meaning;        ///< one line, with unit
  std::string default_value;  ///< as text; empty: none
  bool for_reading = true;
  bool for_writing = false;
  bool is_file = false;  ///< the value names a file that is read: its name does not enter the map's history
};

struct ReadRequest {
  std::string path;
  Settings settings;
  Findings findings;                   ///< kLoss for data that does not survive the import
  std::uint64_t max_memory_bytes = 0;  ///< of a format that is built in memory as a whole; 0: no bound
};

struct WriteRequest {
  std::string path;
  std::string layer;  ///< name of the layer to export; empty: the converter chooses or refuses
  Settings settings;
  OutputOptions output;
  RunOptions run;  ///< run.findings: kLoss for data that does not survive the export
};

enum class Use : std::uint8_t { kReading, kWriting };

/// One foreign format: how it is told, read and written, and what is lost on the way.
class Converter {
 public:
  virtual ~Converter() = default;
  virtual std::string_view name() const = 0;                ///< "octomap"
  virtual std::string_view description() const = 0;         ///< one line
  virtual std::vector<std::string> extensions() const = 0;  ///< ".bt", ".ot"
  virtual bool can_read() const { return true; }
  virtual bool can_write() const { return true; }
  virtual std::vector<SettingSpec> settings() const = 0;
  virtual std::vector<std::string> losses() const = 0;  ///< what the format cannot hold; for --formats
  /// True if a file that starts with `head` (up to 4 KiB) is of this format.
  virtual bool sniffs(std::string_view path, std::span<const std::byte> head) const = 0;
  /// Checks the values of settings without a file.
  /// @throws Error{kInvalidArgument|kLimit} that names the key
  virtual void check_settings(const Settings& settings, Use use) const = 0;
  /// All files `open` reads, `path` first. Fails never: a file that cannot be told is left out.
  virtual std::vector<std::string> files_read(const std::string& path) const { return {path}; }
  /// All files `write` makes of a map with this header, the path first. @throws Error{kInvalidArgument}
  virtual std::vector<std::string> files_written(const MapHeader& /*header*/,
                                                 const WriteRequest& request) const {
    return {request.path};
  }
  /// Whether `write` may make the files beside the path; it looks itself as well.
  /// @throws Error{kOutput} if one of them exists and must not be replaced
  virtual void check_replaceable(const MapHeader& /*header*/, const WriteRequest& /*request*/) const {}
  /// @throws Error as Reader
  virtual std::unique_ptr<PatchSource> open(const ReadRequest& request) const = 0;
  /// Writes whole files or nothing.
  virtual void write(const PatchSource& source, const WriteRequest& request) const = 0;
};

/// All converters this build holds, by name.
const std::vector<const Converter*>& all();
const Converter* find(std::string_view name);
/// The converter whose content rule matches the file's first bytes; nullptr if none does.
const Converter* sniff(const std::string& path);
/// The same for first bytes that were read elsewhere.
const Converter* sniff(const std::string& path, std::span<const std::byte> head);
/// The converter that writes files with this path's extension; nullptr if none does.
const Converter* for_extension(const std::string& path);

}  // namespace apgm::converters

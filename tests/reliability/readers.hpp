#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

namespace apgm::test {

/// What a reader made of a damaged file.
enum class Answer : std::uint8_t {
  kDetected = 'd',  ///< refused
  kWrong = 'w',     ///< accepted, and other cells or another place than were written: silent corruption
  kSame = 's',      ///< accepted, and all is as it was
  kCrash = 'c',     ///< the process died
  kHang = 'h',      ///< no answer in ten seconds
};

/// A foreign format: a file, and its own library's reader.
class Format {
 public:
  virtual ~Format() = default;
  virtual std::string name() const = 0;
  virtual const std::string& file() const = 0;
  /// Reads all of it as a user of the library would. May crash or hang: it is run in a process of its own.
  virtual Answer read(const std::string& bytes) = 0;
};

std::unique_ptr<Format> octomap_ot();
std::unique_ptr<Format> octomap_bt();
std::unique_ptr<Format> geotiff_zstd();

/// Calls `format.read` for each file of `n`, made by `make(i)`, in child processes with bounds on time and
/// memory; one character of Answer each.
std::string read_apart(Format& format, std::size_t n, const std::function<std::string(std::size_t)>& make);

}  // namespace apgm::test

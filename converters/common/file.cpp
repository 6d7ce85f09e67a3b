#include "converters/common/file.hpp"

#include <cctype>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <system_error>

#include "apgm/core/budget.hpp"
#include "apgm/core/error.hpp"

namespace apgm::converters {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& why, const char* hint = "") {
  throw Error(ErrorCode::kUnreadable, "cannot read '" + path + "': " + why).hint(hint).at(path);
}

}  // namespace

std::string read_file(const std::string& path, std::uint64_t max_bytes) {
  namespace fs = std::filesystem;
  if (path == "-") fail(path, "this format is not read from standard input", "pass a file");
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) fail(path, "no such file", "check the name and the directory");
  if (!fs::is_regular_file(status)) fail(path, "not a regular file");
  const std::uintmax_t size = fs::file_size(path, error);
  if (error) fail(path, error.message());
  if (size > max_bytes) {
    throw Error(ErrorCode::kLimit, "'" + path + "' has " + std::to_string(size) + " bytes, more than the " +
                                       std::to_string(max_bytes) + " it may have")
        .hint("raise --max-memory if it is set; else cut the file smaller")
        .at(path);
  }
  std::ifstream in(path, std::ios::binary);
  if (!in) fail(path, std::strerror(errno));
  std::string bytes(static_cast<std::size_t>(size), '\0');
  in.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (static_cast<std::uintmax_t>(in.gcount()) != size) fail(path, "it ended while it was read");
  return bytes;
}

std::string read_file_within(const std::string& path, std::uint64_t max_memory_bytes, std::uint64_t beside) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (!error) check_budget(max_memory_bytes, size + beside, "'" + path + "' is held in memory as a whole");
  // A file that grows meanwhile meets the plain bound.
  return read_file(path,
                   max_memory_bytes != 0 ? max_memory_bytes : std::numeric_limits<std::uint64_t>::max());
}

std::uint64_t budget_left(std::uint64_t max_memory_bytes, std::uint64_t used) {
  if (max_memory_bytes == 0) return 0;
  return used < max_memory_bytes ? max_memory_bytes - used : 1;
}

std::string extension_of(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

}  // namespace apgm::converters

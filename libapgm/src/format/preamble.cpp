#include "preamble.hpp"

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "apgm/core/error.hpp"
#include "located.hpp"

namespace apgm::format {
namespace {

std::string hex(std::span<const std::byte> bytes) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const std::byte b : bytes) {
    if (!text.empty()) text += ' ';
    text += kDigits[static_cast<unsigned>(b) >> 4];
    text += kDigits[static_cast<unsigned>(b) & 15];
  }
  return text;
}

/// Names what a file looks like from its first bytes; nullptr if nothing is recognised.
const char* guess_format(std::span<const std::byte> head) {
  const std::string_view text(reinterpret_cast<const char*>(head.data()), head.size());
  struct Mark {
    std::string_view start;
    const char* name;
  };
  static constexpr Mark kMarks[] = {
      {"\x89PNG", "PNG image"},
      {"# Octomap OcTree", "OctoMap tree"},
      {"P2", "PGM image"},
      {"P5", "PGM image"},
      {"II*", "TIFF image"},
      {"MM", "TIFF image"},
      {"image:", "map_server YAML"},
      {"\x1f\x8b", "gzip archive"},
      {"PK\x03\x04", "zip archive"},
      {"\x28\xb5\x2f\xfd", "zstd archive"},
      {"BZh", "bzip2 archive"},
      {"\xff\xd8\xff", "JPEG image"},
      {"{", "JSON text"},
  };
  for (const Mark& mark : kMarks) {
    if (text.substr(0, mark.start.size()) == mark.start) return mark.name;
  }
  return nullptr;
}

[[noreturn]] void fail_foreign(const InputFile& file, std::span<const std::byte> head) {
  const std::string text = "'" + file.path() + "' is not an apgm file: ";
  if (head.empty()) {
    throw Error(ErrorCode::kForeign, text + "it is empty")
        .hint("nothing was written to it, or all of it was lost")
        .at(file.path(), 0);
  }
  const char* guess = guess_format(head);
  const std::string starts = "starts with " + hex(head.first(std::min<std::size_t>(4, head.size())));
  throw Error(ErrorCode::kForeign, text + starts + (guess == nullptr ? "" : " (" + std::string(guess) + ")"))
      .at(file.path(), 0);
}

[[noreturn]] void fail_unsupported(const InputFile& file, const Preamble& p) {
  if (p.major == kMajor && p.incompat == kStreamBit) {
    throw Error(ErrorCode::kUnsupported, "'" + file.path() + "' is a stream, which has no index")
        .hint("apgm-convert makes a map of it")
        .at(file.path(), 12);
  }
  const std::string version = std::to_string(p.major) + "." + std::to_string(p.minor);
  const std::string what = p.major != kMajor ? "is of format " + version
                                             : "needs features this version does not know (bits " +
                                                   std::to_string(p.incompat) + ")";
  throw Error(ErrorCode::kUnsupported, "'" + file.path() + "' " + what)
      .hint("this program reads format " + std::to_string(kMajor) + ".x; a newer version of apgm can read it")
      .at(file.path(), 8);
}

Bytes hashed(Bytes preamble) { return preamble.first(offsetof(Preamble, hash)); }

}  // namespace

Preamble read_preamble(const InputFile& file) {
  std::vector<std::byte> head(std::min<std::uint64_t>(file.size(), sizeof(Preamble)));
  file.read(0, head);
  if (head.size() < kMagic.size() || std::memcmp(head.data(), kMagic.data(), kMagic.size()) != 0) {
    fail_foreign(file, head);
  }
  if (head.size() < sizeof(Preamble)) fail_damaged(file, head.size(), "the file ends within its preamble");
  const auto p = read_as<Preamble>(head);
  if (p.hash != hash_of(hashed(head))) fail_damaged(file, 0, "the preamble fails its checksum");
  if (p.major != kMajor || p.incompat != 0) fail_unsupported(file, p);
  return p;
}

Preamble make_preamble(bool archive) {
  Preamble preamble;
  if (archive) {
    preamble.minor = kMinorArchive;
    preamble.compat = kCompatArchive;
  }
  preamble.hash = hash_of(hashed(bytes_of(preamble)));
  return preamble;
}

}  // namespace apgm::format

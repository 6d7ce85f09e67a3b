#include "converters/numpy/npy.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <map>

#include "apgm/core/budget.hpp"
#include "apgm/core/error.hpp"
#include "converters/common/settings.hpp"

namespace apgm::converters {
namespace {

static_assert(std::endian::native == std::endian::little, "values are little-endian in files and in memory");

constexpr std::string_view kMagic = "\x93NUMPY";
constexpr std::size_t kMostHeaderBytes = 65536;
constexpr const char* kSaveWrites =
    "numpy.save(path, array) writes such files: float32, (channels, rows, columns)";
constexpr std::int64_t kMostValues = std::int64_t{1} << 40;

[[noreturn]] void fail(ErrorCode code, const std::string& why, const char* hint = kSaveWrites) {
  throw Error(code, why).hint(hint);
}

/// The dictionary of a header: the literal of a Python dict with three known keys.
class Literal {
 public:
  explicit Literal(std::string_view text) : rest_(text) {}

  NpyHeader read() {
    NpyHeader header;
    bool fortran = false;
    int seen = 0;
    take('{');
    while (!next_is('}')) {
      const std::string key = quoted();
      take(':');
      if (key == "descr") {
        header.descr = quoted();
        seen |= 1;
      } else if (key == "fortran_order") {
        fortran = boolean();
        seen |= 2;
      } else if (key == "shape") {
        header.shape = sizes();
        seen |= 4;
      } else {
        bad();
      }
      if (!next_is('}')) take(',');
    }
    take('}');
    skip_blanks();
    if (!rest_.empty() || seen != 7) bad();
    check(header, fortran);
    return header;
  }

 private:
  [[noreturn]] static void bad() { fail(ErrorCode::kDamaged, "its .npy header cannot be read"); }

  static void check(const NpyHeader& header, bool fortran) {
    if (header.descr != "<f4" && header.descr != "<f8") {
      fail(ErrorCode::kUnsupported, "its values are '" + printable(header.descr) + "', not float32",
           "array.astype('<f4') makes them so");
    }
    if (fortran && header.shape.size() > 1) {
      fail(ErrorCode::kUnsupported, "its values lie columns first (Fortran order)",
           "numpy.ascontiguousarray(array) turns them");
    }
  }

  void skip_blanks() { rest_.remove_prefix(std::min(rest_.find_first_not_of(" \n"), rest_.size())); }
  bool next_is(char c) {
    skip_blanks();
    return !rest_.empty() && rest_[0] == c;
  }
  void take(char c) {
    if (!next_is(c)) bad();
    rest_.remove_prefix(1);
  }
  std::string quoted() {
    skip_blanks();
    if (rest_.empty() || (rest_[0] != '\'' && rest_[0] != '"')) bad();
    const std::size_t end = rest_.find(rest_[0], 1);
    if (end == std::string_view::npos) bad();
    std::string text(rest_.substr(1, end - 1));
    rest_.remove_prefix(end + 1);
    return text;
  }
  bool boolean() {
    skip_blanks();
    for (const auto& [word, value] : {std::pair("True", true), std::pair("False", false)}) {
      if (!rest_.starts_with(word)) continue;
      rest_.remove_prefix(std::strlen(word));
      return value;
    }
    bad();
  }
  std::vector<std::int64_t> sizes() {
    std::vector<std::int64_t> list;
    std::int64_t values = 1;
    take('(');
    while (!next_is(')')) {
      std::int64_t size = 0;
      const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), size);
      if (error != std::errc()) bad();
      rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
      if (size < 1) fail(ErrorCode::kUnsupported, "its array has no values");
      if (list.size() == 8 || size > kMostValues / values) {
        fail(ErrorCode::kLimit, "its array has more than 2^40 values or 8 axes");
      }
      values *= size;
      list.push_back(size);
      if (!next_is(')')) take(',');
    }
    take(')');
    if (list.empty()) fail(ErrorCode::kUnsupported, "its array has no axes");
    return list;
  }

  std::string_view rest_;
};

void read_exactly(const std::function<std::size_t(std::span<std::byte>)>& read, std::span<char> out) {
  if (read(std::as_writable_bytes(out)) != out.size()) {
    fail(ErrorCode::kDamaged, "it ends before its array does");
  }
}

}  // namespace

std::int64_t NpyHeader::values() const {
  std::int64_t product = 1;
  for (const std::int64_t size : shape) product *= size;
  return product;
}

std::string npy_head(const NpyHeader& header) {
  std::string dict = "{'descr': '" + header.descr + "', 'fortran_order': False, 'shape': (";
  for (const std::int64_t size : header.shape) dict += std::to_string(size) + ", ";
  // One size needs its comma, more do not.
  if (header.shape.size() > 1) dict.erase(dict.size() - 2);
  dict += "), }";
  constexpr std::size_t kAlign = 64, kBefore = 10;
  dict.append(kAlign - (kBefore + dict.size() + 1) % kAlign, ' ');
  dict += '\n';
  std::string head(kMagic);
  head += {'\x01', '\0', static_cast<char>(dict.size() & 0xff), static_cast<char>(dict.size() >> 8)};
  return head + dict;
}

std::vector<float> read_npy(const std::function<std::size_t(std::span<std::byte>)>& read,
                            std::uint64_t max_bytes, NpyHeader& header, std::uint64_t& rounded) {
  std::string start(8, '\0');
  if (read(std::as_writable_bytes(std::span(start))) != start.size() || !start.starts_with(kMagic)) {
    fail(ErrorCode::kForeign, "it is no .npy file");
  }
  const int major = static_cast<unsigned char>(start[6]);
  if (major < 1 || major > 3) {
    fail(ErrorCode::kUnsupported, "its .npy format is " + std::to_string(major) + ", not 1, 2 or 3");
  }
  std::uint32_t bytes = 0;
  std::string size(major == 1 ? 2 : 4, '\0');
  read_exactly(read, size);
  std::memcpy(&bytes, size.data(), size.size());
  if (bytes > kMostHeaderBytes) fail(ErrorCode::kLimit, "its .npy header has more than 64 KiB");
  std::string dict(bytes, '\0');
  read_exactly(read, dict);
  header = Literal(dict).read();

  const auto count = static_cast<std::uint64_t>(header.values());
  if (count > max_bytes / sizeof(float)) {
    throw over_budget("its array has " + std::to_string(count) + " values, more than memory is given",
                      count * sizeof(float), "cut the array");
  }
  std::vector<float> values;
  values.reserve(count);  // growing would take up to thrice the memory that is given
  std::vector<char> chunk(std::size_t{1} << 18);
  const auto width = static_cast<std::size_t>(header.value_bytes());
  while (values.size() < count) {
    const std::size_t take = std::min<std::size_t>(chunk.size() / width, count - values.size());
    read_exactly(read, std::span(chunk).first(take * width));
    for (std::size_t i = 0; i < take; ++i) {
      double wide = 0;
      float value = 0;
      if (width == sizeof(float)) {
        std::memcpy(&value, chunk.data() + i * width, width);
      } else {
        std::memcpy(&wide, chunk.data() + i * width, width);
        value = static_cast<float>(wide);
        rounded += !std::isnan(wide) && static_cast<double>(value) != wide;
      }
      values.push_back(value);
    }
  }
  std::byte after;
  if (read(std::span(&after, 1)) != 0) fail(ErrorCode::kDamaged, "it goes on after its array");
  return values;
}

}  // namespace apgm::converters

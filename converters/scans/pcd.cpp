#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "converters/common/settings.hpp"
#include "converters/scans/cloud.hpp"
#include "converters/scans/lines.hpp"
#include "converters/scans/lzf.hpp"

namespace apgm::converters {
namespace {

constexpr std::size_t kMostFields = 256;
constexpr std::uint64_t kMostPointBytes = 1 << 16;

enum class Data : std::uint8_t { kAscii, kBinary, kCompressed };

struct Field {
  std::string name;
  std::uint64_t bytes = 0;  // of one of its values
  char type = 'F';
  std::uint64_t count = 1;
  std::uint64_t offset = 0;  // in a point, bytes
  std::uint64_t column = 0;  // in a line of ascii data
};

struct PcdHeader {
  std::vector<Field> fields;
  std::array<Field, 3> xyz;  // bytes = 0: missing
  std::uint64_t point_bytes = 0;
  std::uint64_t columns = 0;
  std::uint64_t points = 0;
  std::optional<Pose> pose;
  bool bad_pose = false;
  Data data = Data::kAscii;
};

/// Reads the lines up to DATA.
class HeaderParser {
 public:
  explicit HeaderParser(LineReader& lines, const std::string& path) : lines_(lines), path_(path) {}

  PcdHeader parse() {
    while (!take_line()) continue;
    lay_out();
    return std::move(header_);
  }

 private:
  [[noreturn]] void fail(const std::string& what, ErrorCode code = ErrorCode::kDamaged) const {
    throw Error(code, "'" + path_ + "' is damaged: " + what + " in line " + std::to_string(lines_.number()))
        .at(path_);
  }

  std::uint64_t number(std::size_t word, std::uint64_t most) const {
    const auto value = word < words_.size() ? number_in<std::uint64_t>(words_[word]) : std::nullopt;
    if (!value) fail(std::string(words_[0]) + " of the cloud is no whole number");
    if (*value > most) fail(std::string(words_[0]) + " of the cloud is too large", ErrorCode::kLimit);
    return *value;
  }

  template <class Set>
  void of_each_field(const Set& set) {
    if (words_.size() != header_.fields.size() + 1) {
      fail(std::string(words_[0]) + " does not have a value for each of the FIELDS");
    }
    for (std::size_t i = 0; i < header_.fields.size(); ++i) set(header_.fields[i], i + 1);
  }

  /// @return true at DATA, the last one
  bool take_line() {
    std::string_view line;
    if (lines_.next(line) != LineReader::Got::kLine) fail("the cloud's header has no end");
    split_words(line, false, words_);
    if (words_.empty() || words_[0].starts_with('#')) return false;
    const std::string_view key = words_[0];
    if (key == "VERSION") return false;
    if (key == "FIELDS" || key == "COLUMNS") {
      take_fields();
    } else if (key == "SIZE") {
      of_each_field([&](Field& f, std::size_t i) { f.bytes = number(i, 8); });
    } else if (key == "TYPE") {
      of_each_field([&](Field& f, std::size_t i) { f.type = words_[i][0]; });
    } else if (key == "COUNT") {
      of_each_field([&](Field& f, std::size_t i) { f.count = number(i, kMostPointBytes); });
    } else if (key == "WIDTH") {
      width_ = number(1, kMostCloudPoints);
    } else if (key == "HEIGHT") {
      height_ = number(1, kMostCloudPoints);
    } else if (key == "POINTS") {
      points_ = number(1, kMostCloudPoints);
    } else if (key == "VIEWPOINT") {
      take_viewpoint();
    } else if (key == "DATA") {
      return take_data();
    } else {
      fail("the cloud's header has an unknown key '" + printable(key) + "'", ErrorCode::kForeign);
    }
    return false;
  }

  void take_fields() {
    if (words_.size() - 1 > kMostFields) fail("the cloud has too many fields", ErrorCode::kLimit);
    header_.fields.clear();
    for (std::size_t i = 1; i < words_.size(); ++i) header_.fields.push_back({std::string(words_[i])});
  }

  void take_viewpoint() {
    std::array<double, 7> v{};
    for (std::size_t i = 0; i < v.size(); ++i) {
      const auto value = i + 1 < words_.size() ? number_in<double>(words_[i + 1]) : std::nullopt;
      if (!value) fail("VIEWPOINT does not have 7 numbers");
      v[i] = *value;
    }
    Pose pose;
    header_.bad_pose = !pose_from({v[0], v[1], v[2]}, v[3], v[4], v[5], v[6], pose);
    if (!header_.bad_pose) header_.pose = pose;
  }

  bool take_data() {
    const std::string_view kind = words_.size() > 1 ? words_[1] : "";
    if (kind != "ascii" && kind != "binary" && kind != "binary_compressed") {
      fail("DATA is none of ascii, binary, binary_compressed");
    }
    header_.data = kind == "ascii" ? Data::kAscii : kind == "binary" ? Data::kBinary : Data::kCompressed;
    return true;
  }

  void lay_out() {
    header_.points = points_.value_or(width_ * height_);
    check_cloud_size(header_.points, path_);
    constexpr std::array<std::string_view, 3> kNames{"x", "y", "z"};
    for (Field& field : header_.fields) {
      field.offset = header_.point_bytes;
      field.column = header_.columns;
      header_.point_bytes += field.bytes * field.count;
      header_.columns += field.count;
      if (header_.point_bytes > kMostPointBytes) fail("a point has too many bytes", ErrorCode::kLimit);
      const auto axis = std::ranges::find(kNames, field.name);
      if (axis == kNames.end()) continue;
      if (field.type != 'F' || (field.bytes != 4 && field.bytes != 8) || field.count != 1) {
        fail("field '" + field.name + "' is no float of 4 or 8 bytes");
      }
      header_.xyz[static_cast<std::size_t>(axis - kNames.begin())] = field;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (header_.xyz[axis].bytes == 0) fail("the cloud has no field '" + std::string(kNames[axis]) + "'");
    }
  }

  LineReader& lines_;
  const std::string& path_;
  std::vector<std::string_view> words_;
  PcdHeader header_;
  std::uint64_t width_ = 0, height_ = 1;
  std::optional<std::uint64_t> points_;
};

float float_at(const char* bytes, const Field& field) {
  if (field.bytes == 4) {
    float value = 0;
    std::memcpy(&value, bytes, sizeof value);
    return value;
  }
  double value = 0;
  std::memcpy(&value, bytes, sizeof value);
  return static_cast<float>(value);
}

void read_ascii(CloudFile& file, LineReader& lines, const PcdHeader& header) {
  std::vector<std::string_view> words;
  std::string_view line;
  std::uint64_t points = 0;
  while (points < header.points) {
    const LineReader::Got got = lines.next(line);
    if (got == LineReader::Got::kEnd) break;
    ++points;
    if (got == LineReader::Got::kTooLong) {
      file.faults.add(Fault::kLongLine, [&] { return lines.place(); });
      continue;
    }
    split_words(line, false, words);
    if (words.size() != header.columns) {
      file.faults.add(Fault::kCutLine, [&] { return lines.place(); });
      continue;
    }
    std::array<float, 3> p{};
    bool numbers = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto value = float_in(words[header.xyz[axis].column]);
      numbers = numbers && value.has_value();
      p[axis] = value.value_or(0);
    }
    if (!numbers) file.faults.add(Fault::kBadNumber, [&] { return lines.place(); });
    if (numbers) file.cloud.xyz_m.insert(file.cloud.xyz_m.end(), p.begin(), p.end());
  }
  if (points < header.points) file.faults.add(Fault::kCutCloud, [&] { return file.bytes.path(); });
}

void read_binary(CloudFile& file, const PcdHeader& header) {
  std::vector<char> point(header.point_bytes);
  for (std::uint64_t i = 0; i < header.points; ++i) {
    if (file.bytes.read(point.data(), point.size()) != point.size()) {
      file.faults.add(Fault::kCutCloud, [&] { return file.bytes.path(); });
      return;
    }
    for (const Field& field : header.xyz) {
      file.cloud.xyz_m.push_back(float_at(point.data() + field.offset, field));
    }
  }
}

/// uint32 packed bytes, uint32 unpacked bytes, LZF data: all of the first field, then all of the second, ...
void read_compressed(CloudFile& file, const PcdHeader& header) {
  const auto damaged = [&](const std::string& what) {
    throw Error(ErrorCode::kDamaged, "'" + file.bytes.path() + "' is damaged: " + what).at(file.bytes.path());
  };
  constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 30;
  constexpr std::uint64_t kBestRatio = 264;  // LZF: 3 bytes stand for at most 264 others, and more
  std::array<std::uint32_t, 2> sizes{};
  if (file.bytes.read(reinterpret_cast<char*>(sizes.data()), sizeof sizes) != sizeof sizes) {
    damaged("it ends before its data");
  }
  const std::uint64_t unpacked_bytes = header.points * header.point_bytes;
  if (sizes[1] != unpacked_bytes) damaged("its data has another size than its points");
  if (unpacked_bytes > kMostBytes || sizes[0] > kMostBytes) {
    throw Error(ErrorCode::kLimit, "'" + file.bytes.path() + "' has more packed data than can be read")
        .at(file.bytes.path());
  }
  std::vector<unsigned char> packed;
  while (packed.size() < sizes[0]) {  // no memory before there are bytes for it
    const std::string_view next = file.bytes.peek();
    if (next.empty()) damaged("it ends within its data");
    const std::size_t n = std::min<std::size_t>(next.size(), sizes[0] - packed.size());
    packed.insert(packed.end(), next.begin(), next.begin() + static_cast<std::ptrdiff_t>(n));
    file.bytes.skip(n);
  }
  if (unpacked_bytes > kBestRatio * packed.size()) damaged("its data cannot be unpacked");
  std::vector<unsigned char> data(unpacked_bytes);
  if (!unpack_lzf(packed, data)) damaged("its data cannot be unpacked");
  file.cloud.xyz_m.resize(3 * header.points);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Field& field = header.xyz[axis];
    const char* column = reinterpret_cast<const char*>(data.data()) + field.offset * header.points;
    for (std::uint64_t i = 0; i < header.points; ++i) {
      file.cloud.xyz_m[3 * i + axis] = float_at(column + i * field.bytes, field);
    }
  }
}

}  // namespace

bool sniffs_pcd(std::string_view head) {
  return head.starts_with("# .PCD v") || (head.starts_with("VERSION") && head.find("\nFIELDS ") != head.npos);
}

void read_pcd(CloudFile& file) {
  LineReader lines(file.bytes);
  const PcdHeader header = HeaderParser(lines, file.bytes.path()).parse();
  lines.finish();
  file.pose = header.pose;
  file.bad_pose = header.bad_pose;
  file.cloud.xyz_m.clear();
  switch (header.data) {
    case Data::kAscii:
      return read_ascii(file, lines, header);
    case Data::kBinary:
      return read_binary(file, header);
    case Data::kCompressed:
      return read_compressed(file, header);
  }
}

}  // namespace apgm::converters

#include "converters/scans/cloud.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "converters/common/settings.hpp"
#include "converters/scans/lines.hpp"

namespace apgm::converters {
namespace {

bool possible(const std::array<double, 3>& position) {
  constexpr double kMost_m = 1e8;
  return std::ranges::all_of(position, [](double v) { return std::fabs(v) <= kMost_m; });
}

struct XyzColumns {
  std::array<std::size_t, 3> at{0, 1, 2};
  std::size_t count = 0;
  bool heading = false;  // the first line holds names, not a point
};

std::string_view first_line(std::string_view head) { return head.substr(0, head.find_first_of("\r\n")); }

/// By a heading with x, y and z; without one, the first three of at least three numbers.
std::optional<XyzColumns> columns_of(std::string_view line) {
  constexpr std::array<std::string_view, 3> kNames{"x", "y", "z"};
  std::vector<std::string_view> words;
  split_words(line, true, words);
  XyzColumns columns;
  columns.count = words.size();
  const auto is_number = [](std::string_view word) { return number_in<double>(word).has_value(); };
  if (words.size() >= 3 && std::ranges::all_of(words, is_number)) return columns;
  columns.heading = true;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto it = std::ranges::find(words, kNames[axis]);
    if (it == words.end()) return {};
    columns.at[axis] = static_cast<std::size_t>(it - words.begin());
  }
  return columns;
}

}  // namespace

void check_cloud_size(std::uint64_t points, const std::string& path) {
  if (points <= kMostCloudPoints) return;
  throw Error(ErrorCode::kLimit, "'" + path + "' says it has a cloud of " + std::to_string(points) +
                                     " points, more than the " + std::to_string(kMostCloudPoints) +
                                     " one may have")
      .at(path);
}

bool pose_from(std::array<double, 3> position, double w, double x, double y, double z, Pose& out) {
  if (!possible(position)) return false;
  try {
    out = Pose::from_quaternion(position, w, x, y, z);
  } catch (const Error&) {
    return false;
  }
  return true;
}

bool pose_from(const std::array<double, 9>& rotation, std::array<double, 3> position, Pose& out) {
  if (!possible(position)) return false;
  const Pose pose{rotation, position};
  try {
    pose.check();
  } catch (const Error&) {
    return false;
  }
  out = pose;
  return true;
}

void read_kitti_cloud(CloudFile& file) {
  constexpr std::size_t kPointBytes = 16, kXyzBytes = 12, kBlock = 4096;
  std::vector<float>& xyz = file.cloud.xyz_m;
  std::vector<char> block(kBlock * kPointBytes);
  xyz.clear();
  for (;;) {
    const std::size_t got = file.bytes.read(block.data(), block.size());
    const std::size_t points = got / kPointBytes;
    check_cloud_size(xyz.size() / 3 + points, file.bytes.path());
    const std::size_t at = xyz.size();
    xyz.resize(at + 3 * points);
    for (std::size_t i = 0; i < points; ++i) {
      std::memcpy(xyz.data() + at + 3 * i, block.data() + i * kPointBytes, kXyzBytes);
    }
    if (got % kPointBytes != 0) file.faults.add(Fault::kCutCloud, [&] { return file.bytes.path(); });
    if (got < block.size()) return;
  }
}

bool sniffs_csv_cloud(std::string_view head) {
  const auto columns = columns_of(first_line(head));
  return columns && columns->heading;
}

void read_csv_cloud(CloudFile& file) {
  LineReader lines(file.bytes);
  std::vector<std::string_view> words;
  std::string_view line;
  std::optional<XyzColumns> columns;
  const auto fault = [&](Fault kind) { file.faults.add(kind, [&] { return lines.place(); }); };
  file.cloud.xyz_m.clear();
  for (auto got = lines.next(line); got != LineReader::Got::kEnd; got = lines.next(line)) {
    if (got == LineReader::Got::kTooLong) {
      fault(Fault::kLongLine);
      continue;
    }
    split_words(line, true, words);
    if (words.empty() || words[0].starts_with('#')) continue;
    if (!columns) {
      columns = columns_of(line);
      if (!columns) {
        throw Error(ErrorCode::kForeign, "'" + file.bytes.path() +
                                             "' has neither a heading with x, y and z nor numbers in line " +
                                             std::to_string(lines.number()))
            .at(file.bytes.path());
      }
      if (columns->heading) continue;
    }
    if (words.size() < columns->count) {
      fault(Fault::kCutLine);
      continue;
    }
    std::array<std::optional<float>, 3> p;
    for (std::size_t axis = 0; axis < 3; ++axis) p[axis] = float_in(words[columns->at[axis]]);
    if (!p[0] || !p[1] || !p[2]) {
      fault(Fault::kBadNumber);
      continue;
    }
    check_cloud_size(file.cloud.xyz_m.size() / 3 + 1, file.bytes.path());
    for (const auto& v : p) file.cloud.xyz_m.push_back(*v);
  }
}

}  // namespace apgm::converters

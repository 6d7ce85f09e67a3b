#include "converters/scans/pose_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>

#include "converters/common/settings.hpp"
#include "converters/scans/cloud.hpp"
#include "converters/scans/lines.hpp"

namespace apgm::converters {
namespace {

using Row = PoseFile::Row;
using Kind = PoseFile::Kind;

constexpr std::size_t kMostRows = 10'000'000;
constexpr std::size_t kKittiValues = 12, kTumValues = 8, kListValues = 17;
constexpr const char* kListHeading = "reading";

std::size_t values_of(Kind kind) {
  return kind == Kind::kKitti ? kKittiValues : kind == Kind::kTum ? kTumValues : kListValues;
}

/// The numbers of a row from word `from` on; nullopt if one is none.
std::optional<std::vector<double>> numbers(const std::vector<std::string_view>& words, std::size_t from) {
  std::vector<double> values;
  for (std::size_t i = from; i < words.size(); ++i) {
    const auto value = number_in<double>(words[i]);
    if (!value) return {};
    values.push_back(*value);
  }
  return values;
}

/// Rows of a 3 x 4 matrix, row-major.
std::optional<Pose> matrix_pose(const std::vector<double>& v) {
  Pose pose;
  const bool good =
      pose_from({v[0], v[1], v[2], v[4], v[5], v[6], v[8], v[9], v[10]}, {v[3], v[7], v[11]}, pose);
  return good ? std::optional(pose) : std::nullopt;
}

/// What a row of the right length holds; a pose only if it is possible.
void take_row(Kind kind, const std::vector<std::string_view>& words, Row& row, const auto& fault) {
  if (kind == Kind::kList) row.name = std::string(words[0]);
  const auto v = numbers(words, kind == Kind::kList ? 1 : 0);
  if (!v) return fault(Fault::kBadNumber);
  if (kind == Kind::kTum) {
    row.stamp_ns = nanoseconds((*v)[0]);
    if (!row.stamp_ns) return fault(Fault::kBadNumber);
    Pose pose;
    if (pose_from({(*v)[1], (*v)[2], (*v)[3]}, (*v)[7], (*v)[4], (*v)[5], (*v)[6], pose)) row.pose = pose;
  } else {
    row.pose = matrix_pose(*v);
  }
  if (!row.pose) fault(Fault::kBadPose);
}

std::optional<Kind> kind_of(const std::vector<std::string_view>& words) {
  if (words[0] == kListHeading) return Kind::kList;
  if (words.size() == kKittiValues) return Kind::kKitti;
  if (words.size() == kTumValues) return Kind::kTum;
  return {};
}

[[noreturn]] void fail_kind(const std::string& path, std::uint64_t line) {
  throw Error(ErrorCode::kForeign, "'" + path + "' is no pose file: line " + std::to_string(line) +
                                       " is neither 12 numbers, nor 8, nor a heading 'reading, ...'")
      .hint("KITTI: 12 numbers of a 3 x 4 matrix; TUM: time x y z qx qy qz qw; docs/scans.md")
      .at(path);
}

/// Of the cloud, whether it is packed or not.
std::string name_of(const std::string& path) {
  return std::filesystem::path(unpacked_name(path)).filename().string();
}
std::string stem_of(const std::string& path) { return std::filesystem::path(name_of(path)).stem().string(); }

/// Rows for clouds, by one way of finding them; a cloud without a row gets nullptr.
using Rows = std::vector<const Row*>;

Rows by_name(const PoseFile& poses, const std::vector<PlacedCloud>& clouds) {
  std::map<std::string, const Row*> named;
  for (const Row& row : poses.rows) named.emplace(name_of(row.name), &row);
  Rows rows;
  for (const PlacedCloud& cloud : clouds) {
    const auto it = named.find(name_of(cloud.path));
    rows.push_back(it == named.end() ? nullptr : it->second);
  }
  return rows;
}

Rows by_number(const PoseFile& poses, const std::vector<PlacedCloud>& clouds) {
  Rows rows;
  for (const PlacedCloud& cloud : clouds) {
    const auto row = number_in<std::uint64_t>(stem_of(cloud.path));
    rows.push_back(row && *row < poses.rows.size() ? &poses.rows[*row] : nullptr);
  }
  return rows;
}

Rows by_time(const PoseFile& poses, const std::vector<PlacedCloud>& clouds) {
  constexpr std::int64_t kNear_ns = 50'000'000;
  std::map<std::int64_t, const Row*> times;
  for (const Row& row : poses.rows) {
    if (row.stamp_ns) times.emplace(*row.stamp_ns, &row);
  }
  Rows rows;
  for (const PlacedCloud& cloud : clouds) {
    const auto seconds = number_in<double>(stem_of(cloud.path));
    const auto stamp = seconds ? nanoseconds(*seconds) : std::nullopt;
    const Row* nearest = nullptr;
    if (stamp) {
      std::int64_t distance = kNear_ns + 1;
      const auto consider = [&](auto it) {
        if (std::abs(it->first - *stamp) >= distance) return;
        distance = std::abs(it->first - *stamp);
        nearest = it->second;
      };
      const auto after = times.lower_bound(*stamp);
      if (after != times.begin()) consider(std::prev(after));
      if (after != times.end()) consider(after);
    }
    rows.push_back(nearest);
  }
  return rows;
}

bool all_found(const Rows& rows) {
  return std::ranges::none_of(rows, [](const Row* row) { return row == nullptr; });
}
bool any_found(const Rows& rows) {
  return std::ranges::any_of(rows, [](const Row* row) { return row != nullptr; });
}

Rows choose_rows(const PoseFile& poses, const std::vector<PlacedCloud>& clouds) {
  if (poses.kind == Kind::kList) {
    if (Rows rows = by_name(poses, clouds); all_found(rows)) return rows;
  }
  if (poses.rows.size() == clouds.size()) {
    Rows rows;
    for (const Row& row : poses.rows) rows.push_back(&row);
    return rows;
  }
  Rows rows = poses.kind == Kind::kList  ? by_name(poses, clouds)
              : poses.kind == Kind::kTum ? by_time(poses, clouds)
                                         : by_number(poses, clouds);
  if (any_found(rows)) return rows;
  throw Error(ErrorCode::kIncompatible, "'" + poses.path + "' has " + std::to_string(poses.rows.size()) +
                                            " poses for " + std::to_string(clouds.size()) +
                                            " clouds, and the clouds' names do not tell which are theirs")
      .hint(
          "give as many poses as clouds, or call each cloud by the number of its row (KITTI) or its time "
          "in seconds (TUM)")
      .at(poses.path);
}

}  // namespace

bool sniffs_cloud_list(std::string_view head) {
  std::vector<std::string_view> words;
  split_words(head.substr(0, head.find_first_of("\r\n")), true, words);
  return words.size() == kListValues && words[0] == kListHeading;
}

PoseFile read_poses(const std::string& path, ScanFaults& faults) {
  ByteStream bytes(path);
  LineReader lines(bytes);
  PoseFile poses;
  poses.path = path;
  std::optional<Kind> kind;
  std::vector<std::string_view> words;
  std::string_view line;
  bool usable = false;
  const auto fault = [&](Fault what) { faults.add(what, [&] { return lines.place(); }); };
  for (auto got = lines.next(line); got != LineReader::Got::kEnd; got = lines.next(line)) {
    split_words(got == LineReader::Got::kTooLong ? std::string_view() : line, true, words);
    const bool blank = words.empty() || words[0].starts_with('#');
    if (blank && got != LineReader::Got::kTooLong) continue;
    if (!kind) {
      kind = blank ? std::nullopt : kind_of(words);
      if (!kind) fail_kind(path, lines.number());
      if (*kind == Kind::kList) continue;
    }
    if (poses.rows.size() == kMostRows) {
      throw Error(ErrorCode::kLimit, "'" + path + "' has more than " + std::to_string(kMostRows) + " poses")
          .at(path);
    }
    Row& row = poses.rows.emplace_back();
    row.line = lines.number();
    if (words.size() == values_of(*kind)) {
      take_row(*kind, words, row, fault);
    } else {
      fault(Fault::kCutLine);
    }
    usable = usable || row.pose.has_value();
  }
  if (!kind) fail_kind(path, lines.number());
  poses.kind = *kind;
  if (usable) return poses;
  const auto list = faults.list();
  throw Error(ErrorCode::kDamaged,
              "'" + path + "' holds no usable pose" + (list.empty() ? "" : ": " + list.back().text))
      .at(path);
}

void place_clouds(const PoseFile& poses, std::vector<PlacedCloud>& clouds, ScanFaults& faults) {
  const Rows rows = choose_rows(poses, clouds);
  for (std::size_t i = 0; i < clouds.size(); ++i) {
    PlacedCloud& cloud = clouds[i];
    const Row* row = rows[i];
    if (row == nullptr) faults.add(Fault::kNoPose, [&] { return cloud.path; });
    cloud.lost = row == nullptr || !row->pose;
    if (cloud.lost) continue;
    cloud.pose = row->pose;
    cloud.stamp_ns = row->stamp_ns;
  }
}

}  // namespace apgm::converters

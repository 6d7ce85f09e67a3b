#include "converters/scans/carmen.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

namespace apgm::converters {
namespace {

enum class Kind : std::uint8_t { kLaser, kRobotLaser, kIgnored };

struct Keyword {
  std::string_view word;
  Kind kind;
  std::size_t sensor = 0;
};

constexpr std::array<Keyword, 27> kKeywords{{{"FLASER", Kind::kLaser, 0},
                                             {"RLASER", Kind::kLaser, 1},
                                             {"ROBOTLASER1", Kind::kRobotLaser, 2},
                                             {"ROBOTLASER2", Kind::kRobotLaser, 3},
                                             {"PARAM", Kind::kIgnored},
                                             {"ODOM", Kind::kIgnored},
                                             {"NEFF", Kind::kIgnored},
                                             {"TRUEPOS", Kind::kIgnored},
                                             {"SYNC", Kind::kIgnored},
                                             {"RAWLASER1", Kind::kIgnored},
                                             {"RAWLASER2", Kind::kIgnored},
                                             {"RAWLASER3", Kind::kIgnored},
                                             {"RAWLASER4", Kind::kIgnored},
                                             {"LASER3", Kind::kIgnored},
                                             {"LASER4", Kind::kIgnored},
                                             {"LASER5", Kind::kIgnored},
                                             {"REMISSIONFLASER", Kind::kIgnored},
                                             {"REMISSIONRLASER", Kind::kIgnored},
                                             {"POSITION", Kind::kIgnored},
                                             {"IMU", Kind::kIgnored},
                                             {"VECTORMOVE", Kind::kIgnored},
                                             {"ROBOTVELOCITY", Kind::kIgnored},
                                             {"FOLLOWTRAJECTORY", Kind::kIgnored},
                                             {"BASEVELOCITY", Kind::kIgnored},
                                             {"SM_UPDATE", Kind::kIgnored},
                                             {"NMEAGGA", Kind::kIgnored},
                                             {"NMEARMC", Kind::kIgnored}}};

constexpr std::array<const char*, 4> kSensors{"front", "rear", "laser1", "laser2"};

/// What a SICK scanner of the CARMEN age gives where nothing came back: 81.83 to 81.91 m.
constexpr double kNoReturn_m = 81.8;

const Keyword* keyword(std::string_view word) {
  const auto it = std::ranges::find(kKeywords, word, &Keyword::word);
  return it == kKeywords.end() ? nullptr : &*it;
}

/// Angles of ROBOTLASER are printed with six digits; where the field of view divides into the same step, that
/// is the more exact.
double angle_step(double fov, double step, std::size_t beams) {
  constexpr double kRounding = 1e-6;
  const auto n = static_cast<double>(beams);
  if (std::fabs(fov / n - step) < kRounding) return fov / n;
  if (beams > 1 && (step == 0 || std::fabs(fov / (n - 1) - step) < kRounding)) return fov / (n - 1);
  return step;
}

}  // namespace

CarmenLog::CarmenLog(std::unique_ptr<ByteStream> bytes, ScanFaults& faults)
    : bytes_(std::move(bytes)), lines_(*bytes_), faults_(faults) {}

bool CarmenLog::sniffs(std::string_view head) {
  constexpr int kLines = 64;
  for (int i = 0; i < kLines && !head.empty(); ++i) {
    const std::size_t end = std::min(head.find('\n'), head.size());
    const std::string_view line = head.substr(0, end);
    head.remove_prefix(std::min(end + 1, head.size()));
    if (line.empty() || line.starts_with('#') || line == "\r") continue;
    return keyword(line.substr(0, line.find_first_of(" \t\r"))) != nullptr;
  }
  return false;
}

bool CarmenLog::next(Measurement& out) {
  std::string_view line;
  for (;;) {
    const LineReader::Got got = lines_.next(line);
    if (got == LineReader::Got::kEnd) return false;
    if (got == LineReader::Got::kTooLong) {
      fault(Fault::kLongLine);
      continue;
    }
    if (line.empty() || line.starts_with('#')) continue;
    const Keyword* known = keyword(line.substr(0, line.find_first_of(" \t")));
    if (known == nullptr) {
      fault(Fault::kUnknownLine);
      continue;
    }
    if (known->kind == Kind::kIgnored) continue;
    split_words(line, false, words_);
    LaserScan& scan = as<LaserScan>(out);
    scan.source = kSensors[known->sensor];
    if (!(known->kind == Kind::kLaser ? read_laser(scan) : read_robot_laser(scan))) continue;
    const std::optional<Fault> out_of_order = times_[known->sensor].fault_of(scan.stamp_ns);
    if (!out_of_order) return true;
    fault(*out_of_order);
  }
}

bool CarmenLog::fault(Fault kind) {
  faults_.add(kind, [this] { return lines_.place(); });
  return false;
}

/// Lines end in a time, the name of a host and another time: with these a line is whole, but its count wrong.
bool CarmenLog::fault_of_length() {
  const std::size_t n = words_.size();
  const bool whole = n > 3 && number_in<double>(words_[n - 3]) && !number_in<double>(words_[n - 2]) &&
                     number_in<double>(words_[n - 1]);
  return fault(whole ? Fault::kBeamCount : Fault::kCutLine);
}

/// FLASER N r[N] x y theta odom_x odom_y odom_theta time host time: the field of view is 180 degrees.
bool CarmenLog::read_laser(LaserScan& scan) {
  constexpr std::size_t kReadings = 2, kAfter = 9;
  const auto count = words_.size() > 1 ? number_in<std::size_t>(words_[1]) : std::nullopt;
  if (!count || *count == 0 || *count > words_.size() || words_.size() != kReadings + *count + kAfter) {
    return fault_of_length();
  }
  scan.angle_min_rad = -std::numbers::pi / 2;
  const std::size_t gaps = *count % 2 == 0 ? *count : std::max<std::size_t>(*count - 1, 1);
  scan.angle_step_rad = std::numbers::pi / static_cast<double>(gaps);
  scan.max_range_m = kNoReturn_m;
  const std::size_t pose = kReadings + *count;
  return take_readings(kReadings, *count, scan) && take_place(pose, pose + 6, scan);
}

/// ROBOTLASER1 type start fov step max accuracy mode N r[N] M remission[M] laser_x y theta robot_x y theta
/// tv rv forward side turn time host time
bool CarmenLog::read_robot_laser(LaserScan& scan) {
  constexpr std::size_t kCount = 8, kReadings = 9, kAfter = 14;
  const auto count = words_.size() > kCount ? number_in<std::size_t>(words_[kCount]) : std::nullopt;
  if (!count || *count == 0 || *count >= words_.size() - kReadings + 1) return fault_of_length();
  const std::size_t more = kReadings + *count;
  const auto remissions = more < words_.size() ? number_in<std::size_t>(words_[more]) : std::nullopt;
  if (!remissions || *remissions > words_.size() || words_.size() != more + 1 + *remissions + kAfter) {
    return fault_of_length();
  }
  std::array<double, 4> v{};  // start, field of view, step, maximum range
  for (std::size_t i = 0; i < v.size(); ++i) {
    constexpr double kMost = 1e4;
    const auto value = number_in<double>(words_[2 + i]);
    if (!value || !(std::fabs(*value) <= kMost)) return fault(Fault::kBadNumber);
    v[i] = *value;
  }
  if (v[3] <= 0) return fault(Fault::kBadNumber);
  scan.angle_min_rad = v[0];
  scan.angle_step_rad = angle_step(v[1], v[2], *count);
  scan.max_range_m = v[3];
  const std::size_t pose = more + 1 + *remissions;
  return take_readings(kReadings, *count, scan) && take_place(pose, pose + 11, scan);
}

bool CarmenLog::take_readings(std::size_t from, std::size_t count, LaserScan& scan) {
  scan.ranges_m.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto value = float_in(words_[from + i]);
    if (!value) return fault(Fault::kBadNumber);
    scan.ranges_m[i] = *value;
  }
  return true;
}

bool CarmenLog::take_place(std::size_t pose_at, std::size_t time_at, LaserScan& scan) {
  constexpr double kMost_m = 1e8, kMost_rad = 1e4;
  const auto x = number_in<double>(words_[pose_at]), y = number_in<double>(words_[pose_at + 1]),
             yaw = number_in<double>(words_[pose_at + 2]), time = number_in<double>(words_[time_at]);
  const auto stamp_ns = time ? nanoseconds(*time) : std::nullopt;
  if (!x || !y || !yaw || !stamp_ns) return fault(Fault::kBadNumber);
  const bool possible = std::fabs(*x) <= kMost_m && std::fabs(*y) <= kMost_m && std::fabs(*yaw) <= kMost_rad;
  if (!possible) return fault(Fault::kBadPose);
  scan.pose = Pose::planar(*x, *y, *yaw);
  scan.stamp_ns = *stamp_ns;
  return true;
}

}  // namespace apgm::converters

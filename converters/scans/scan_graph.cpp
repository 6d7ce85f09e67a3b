#include "converters/scans/scan_graph.hpp"

#include <array>
#include <cmath>
#include <cstring>

#include "converters/scans/cloud.hpp"

namespace apgm::converters {
namespace {

// All little-endian: uint32 nodes; a node: uint32 points, points, position, uint32 4, quaternion w x y z,
// uint32 id; a point or position: uint32 3, double x y z. Edges follow the nodes.
constexpr std::uint32_t kPoint = 3, kQuaternion = 4;

template <class Value>
Value value_at(std::string_view bytes, std::size_t at) {
  Value value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

}  // namespace

ScanGraph::ScanGraph(std::unique_ptr<ByteStream> bytes, ScanFaults& faults)
    : bytes_(std::move(bytes)), faults_(faults) {}

bool ScanGraph::sniffs(std::string_view head) {
  constexpr std::uint32_t kMostNodes = 1u << 24;
  if (head.size() < 40) return false;
  const auto nodes = value_at<std::uint32_t>(head, 0), points = value_at<std::uint32_t>(head, 4);
  return nodes > 0 && nodes <= kMostNodes && points > 0 && points <= kMostCloudPoints &&
         value_at<std::uint32_t>(head, 8) == kPoint && std::isfinite(value_at<double>(head, 12)) &&
         (points == 1 || value_at<std::uint32_t>(head, 36) == kPoint);
}

void ScanGraph::damaged(const std::string& what) const {
  throw Error(ErrorCode::kDamaged,
              "'" + bytes_->path() + "' is damaged: " + what + " at byte " + std::to_string(bytes_->offset()))
      .at(bytes_->path(), bytes_->offset());
}

void ScanGraph::read_exactly(char* out, std::size_t n) {
  if (bytes_->read(out, n) != n) damaged("the scan graph ends within a scan");
}

std::uint32_t ScanGraph::read_count(const char* what) {
  std::array<char, 4> bytes;
  if (bytes_->read(bytes.data(), bytes.size()) != bytes.size()) {
    damaged(std::string("the scan graph ends before its ") + what);
  }
  return value_at<std::uint32_t>({bytes.data(), bytes.size()}, 0);
}

void ScanGraph::read_vector(std::uint32_t dimensions, double* out) {
  if (read_count("coordinates") != dimensions) damaged("a point has another number of coordinates");
  read_exactly(reinterpret_cast<char*>(out), dimensions * sizeof(double));
}

void ScanGraph::read_points(PointCloud& cloud) {
  const std::uint32_t points = read_count("points");
  check_cloud_size(points, bytes_->path());
  cloud.xyz_m.clear();
  for (std::uint32_t i = 0; i < points; ++i) {
    std::array<double, 3> p;
    read_vector(kPoint, p.data());
    for (const double v : p) cloud.xyz_m.push_back(static_cast<float>(v));
  }
}

bool ScanGraph::read_pose(Pose& pose) {
  std::array<double, 3> position;
  std::array<double, 4> q;
  read_vector(kPoint, position.data());
  read_vector(kQuaternion, q.data());
  (void)read_count("scan's number");
  return pose_from(position, q[0], q[1], q[2], q[3], pose);
}

bool ScanGraph::next(Measurement& out) {
  if (!started_) nodes_ = read_count("number of scans");
  started_ = true;
  while (node_ < nodes_) {
    PointCloud& cloud = as<PointCloud>(out);
    cloud.stamp_ns = static_cast<std::int64_t>(node_) * kScanInterval_ns;
    read_points(cloud);
    ++node_;
    if (read_pose(cloud.pose)) return true;
    faults_.add(Fault::kBadPose, [this] { return bytes_->path() + ", scan " + std::to_string(node_ - 1); });
  }
  return false;
}

}  // namespace apgm::converters

#include "converters/scans/formats.hpp"

#include <algorithm>
#include <array>

#include "converters/common/file.hpp"
#include "converters/common/settings.hpp"
#include "converters/scans/carmen.hpp"
#include "converters/scans/cloud.hpp"
#include "converters/scans/pose_file.hpp"
#include "converters/scans/scan_graph.hpp"

namespace apgm::converters {
namespace {

constexpr std::array<ScanFormat, 6> kFormats{
    {{"carmen", "CARMEN logs with FLASER, RLASER, ROBOTLASER1, ROBOTLASER2 lines (.log, .clf)"},
     {"cloud_list", "libpointmatcher's list of clouds with their poses (.csv)"},
     {"csv", "clouds as lines of numbers, with or without a heading (.csv, .xyz)"},
     {"graph", "OctoMap's scan graphs (.graph)"},
     {"kitti", "clouds of float32 x, y, z, intensity (.bin)"},
     {"pcd", "Point Cloud Library clouds: ascii, binary, binary_compressed (.pcd)"}}};

std::string extension_within(const std::string& path) { return extension_of(unpacked_name(path)); }

}  // namespace

std::string unpacked_name(std::string path) {
  constexpr std::string_view kPacked = ".bz2";
  if (extension_of(path) == kPacked) path.resize(path.size() - kPacked.size());
  return path;
}

std::span<const ScanFormat> scan_formats() { return kFormats; }

Format format_named(const std::string& name) {
  const auto it = std::ranges::find(kFormats, name, &ScanFormat::name);
  if (it != kFormats.end()) return static_cast<Format>(it - kFormats.begin());
  std::string known;
  for (const ScanFormat& format : kFormats) known += (known.empty() ? "" : ", ") + std::string(format.name);
  throw Error(ErrorCode::kInvalidArgument, "there is no format of scans '" + name + "'")
      .hint("the formats are " + known);
}

bool is_cloud_name(const std::string& path) {
  const std::string extension = extension_within(path);
  return extension == ".pcd" || extension == ".bin" || extension == ".csv" || extension == ".xyz";
}

Format format_of(const std::string& path, std::string_view head) {
  if (sniffs_pcd(head)) return Format::kPcd;
  if (CarmenLog::sniffs(head)) return Format::kCarmen;
  if (sniffs_cloud_list(head)) return Format::kCloudList;
  if (sniffs_csv_cloud(head)) return Format::kCsv;
  const std::string extension = extension_within(path);
  if (extension == ".bin") return Format::kKitti;
  if (ScanGraph::sniffs(head)) return Format::kGraph;
  if (extension == ".log" || extension == ".clf") return Format::kCarmen;
  if (extension == ".graph") return Format::kGraph;
  if (extension == ".pcd") return Format::kPcd;
  if (extension == ".csv" || extension == ".xyz") return Format::kCsv;
  const std::string start =
      head.empty() ? "it is empty" : "it starts with '" + printable(head.substr(0, 16)) + "'";
  throw Error(ErrorCode::kForeign, "'" + path + "' is of no known format of scans: " + start)
      .hint("--from names the format where content and extension do not tell it")
      .at(path);
}

}  // namespace apgm::converters

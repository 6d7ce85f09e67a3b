#pragma once

#include <cstdint>

#include "apgm/observe/mapper.hpp"
#include "converters/scans/scan_reader.hpp"

namespace apgm::tools {

inline std::int64_t stamp_of(const converters::Measurement& m) {
  return std::visit([](const auto& scan) { return scan.stamp_ns; }, m);
}

/// Where the vehicle was.
inline Point position_of(const converters::Measurement& m) {
  if (const auto* image = std::get_if<LabelledGround>(&m)) return image->origin;
  if (const auto* cloud = std::get_if<PointCloud>(&m)) return cloud->pose.position();
  return std::get<LaserScan>(m).pose.position();
}

/// Maps one measurement. @param beams  grows by its beams, `skipped` by readings that were not used
inline MapperReport add_measurement(Mapper& mapper, const converters::Measurement& m,
                                    const RangeLimits& limits, Skipped& skipped, std::uint64_t& beams) {
  const auto add_range = [&](const auto& readings) {
    const RangeScan scan = to_range_scan(readings, limits, skipped);
    beams += scan.beams.size();
    return mapper.add(scan);
  };
  if (const auto* scan = std::get_if<LaserScan>(&m)) return add_range(*scan);
  if (const auto* cloud = std::get_if<PointCloud>(&m)) return add_range(*cloud);
  return mapper.add(std::get<LabelledGround>(m));
}

}  // namespace apgm::tools

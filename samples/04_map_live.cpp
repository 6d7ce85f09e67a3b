// Builds a map while a robot drives, and keeps a copy of it elsewhere: only what changed goes over the wire.
//
//   04_map_live OUTPUT.apgm      (the crop round the robot at the end)

#include <cstddef>
#include <cstdio>
#include <vector>

#include "apgm/format/message.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/observe/mapper.hpp"
#include "apgm/ops/crop.hpp"
#include "support/hall.hpp"

namespace {

constexpr double kPi = 3.141592653589793;

/// True if both maps have the same layers with the same bits in every cell.
bool same(const apgm::Map& a, const apgm::Map& b) {
  if (a.size() != b.size()) return false;
  for (const auto& [key, patch] : a.by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      const apgm::Layer* other = b.find(patch.index, type);
      if (other == nullptr || !apgm::same_cells(layer, *other)) return false;
    }
  }
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: 04_map_live OUTPUT.apgm\n", stderr);
    return 2;
  }
  try {
    // Near the robot 0.1 m cells, farther away 0.4 m; what is more than 25 m away is forgotten.
    const apgm::Schedule schedule = apgm::parse_profiles(R"(
requirements:
  - layer: occupancy
    bands:
      - {from_m: 0, to_m: 10, cell_m: 0.1}
      - {from_m: 10, to_m: 25, cell_m: 0.4}
)",
                                                         "profile");
    const apgm::Models models;  // the defaults: a laser after Nuss et al.
    apgm::Mapper mapper(apgm::Frame{}, models);
    mapper.set_profile(schedule.at(0));

    apgm::Map copy(mapper.map().header());  // on another computer
    std::size_t sent_bytes = 0;
    apgm::Skipped skipped;
    apgm::Point robot;
    for (int step = 0; step <= 40; ++step) {
      robot = {10.0 + step, 9.0};
      const std::int64_t stamp_ns = step * 1'000'000'000LL;
      mapper.move_to(robot, stamp_ns);
      const apgm::LaserScan scan = apgm::samples::scan_of_the_hall(robot, stamp_ns, -kPi, 720);  // all round
      mapper.add(apgm::to_range_scan(scan, models.limits, skipped));

      const std::vector<std::byte> message = apgm::to_bytes(mapper.take_changes());
      sent_bytes += message.size();
      apgm::apply(apgm::changes_from_bytes(message), copy);
      if (!same(mapper.map(), copy)) {
        std::fprintf(stderr, "04_map_live: error: the copy differs after step %d\n", step);
        return 70;
      }
    }
    std::printf("%zu patches, %zu bytes sent in 41 messages, the copy is equal\n", copy.size(), sent_bytes);

    // At any time a part of it can go elsewhere: here what lies within 8 m of the robot, into a file.
    apgm::CropRegion near;
    near.box = apgm::Box{{robot.x_m - 8, robot.y_m - 8}, {robot.x_m + 8, robot.y_m + 8}};
    apgm::Writer writer(argv[1], apgm::crop_header(copy, near, {}));
    apgm::crop(copy, near, {}, writer);
    writer.finish();
    std::printf("%s: %llu patches\n", argv[1], static_cast<unsigned long long>(writer.report().patches));
    return 0;
  } catch (const apgm::Error& e) {
    std::fprintf(stderr, "04_map_live: error: %s\n", e.what());
    return e.code() == apgm::ErrorCode::kOutput ? 5 : 70;
  }
}

#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "apgm/core/portable_math.hpp"
#include "apgm/observe/mapper.hpp"
#include "random_map.hpp"

namespace apgm::test {

inline constexpr std::int64_t kSecond = 1'000'000'000;

/// Patches of 12.8 m in few cells, so that tests may make many.
inline MapperOptions coarse_options() {
  MapperOptions options;
  options.cell_m = 0.8;
  return options;
}

/// Beams all round from `origin`, each as long as it happens to be.
inline RangeScan random_scan(Random& random, Point origin, std::int64_t stamp_ns) {
  RangeScan scan;
  scan.source = "lidar";
  scan.stamp_ns = stamp_ns;
  scan.origin = origin;
  const int beams = random.in(5, 40);
  for (int i = 0; i < beams; ++i) {
    const double angle = 2 * 3.141592653589793 * random.unit(), length = 1 + 25 * random.unit();
    scan.beams.push_back(
        {origin,
         {origin.x_m + length * portable::cos(angle), origin.y_m + length * portable::sin(angle)},
         random.chance(0.8)});
  }
  return scan;
}

inline LabelledGround random_image(Random& random, Point origin, std::int64_t stamp_ns) {
  LabelledGround image;
  image.stamp_ns = stamp_ns;
  image.origin = origin;
  for (int i = random.in(5, 60); i > 0; --i) {
    image.pixels.push_back({{origin.x_m + 20 * random.unit(), origin.y_m + 10 * random.unit() - 5},
                            static_cast<std::uint8_t>(random.below(3))});
  }
  return image;
}

inline Requirement disc(const std::string& layer, double radius_m, double cell_m) {
  return {layer, cell_m, Ring{0, radius_m}};
}

/// Those of the paper's drive, on small scale.
inline Profile parking() { return {"parking", {disc("occupancy", 10, 0.4)}}; }
inline Profile road() { return {"road", {disc("occupancy", 30, 0.8), disc("semantics", 20, 1.6)}}; }

struct DriveOptions {
  int steps = 40;
  bool profiles = true;
  bool sources = true;  ///< layers made elsewhere, of types the mapper may not know
};

/// Calls of a mapper that depend on the seed alone: scans, images, foreign layers, moves, other profiles,
/// times that go back. `after` is called after each.
template <typename After>
void drive(Mapper& mapper, std::uint64_t seed, const DriveOptions& options, After after) {
  Random random(seed);
  Point at{0, 0};
  std::int64_t now_ns = 5 * kSecond;
  mapper.move_to(at, now_ns);
  for (int i = 0; i < options.steps; ++i) {
    at = {at.x_m + 8 * random.unit() - 3, at.y_m + 6 * random.unit() - 3};
    if (random.chance(0.1)) at = {0, 0};
    now_ns += random.chance(0.1) ? -kSecond : random.below(3) * kSecond / 3;
    const float alpha = random.chance(0.2) ? 0.7f : 1.0f;
    const int what = random.below(10);
    if (what < 4) {
      mapper.add(random_scan(random, at, now_ns), alpha);
    } else if (what < 6) {
      mapper.add(random_image(random, at, now_ns), alpha);
    } else if (what < 7 && options.sources) {
      RandomMapOptions foreign;
      foreign.fill = 0.3;
      foreign.types = {LayerType::occupancy("occupancy", Policy::kExclusive),
                       LayerType::real("height", {"z"})};
      mapper.add(random_map(random.next(), foreign), alpha);
    } else if (what < 8 && options.profiles) {
      const int which = random.below(3);
      mapper.set_profile(which == 0 ? std::nullopt : std::optional(which == 1 ? parking() : road()));
    } else {
      mapper.move_to(at, now_ns);
    }
    after();
  }
}

/// A store in memory, that can be told to fail.
class MemoryStore final : public PatchStore {
 public:
  explicit MemoryStore(const Frame& frame) : map(header_of(frame)) {}
  void set_types(const TypeTable& types) override { map.set_types(types); }
  void store(const Patch& patch) override {
    if (fails) throw std::runtime_error("full");
    map.patch(patch.index) = patch;
  }
  bool take(PatchIndex index, Patch& out) override {
    if (map.find(index) == nullptr) return false;
    out = *map.find(index);
    for (const auto& [type, layer] : out.layers) map.extract(index, type);
    return true;
  }

  Map map;
  bool fails = false;

 private:
  static MapHeader header_of(const Frame& frame) {
    MapHeader header;
    header.frame = frame;
    return header;
  }
};

}  // namespace apgm::test

#include "city.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "apgm/core/error.hpp"

namespace apgm::bench {
namespace {

constexpr std::int64_t kSide = std::int64_t{1} << City::kStep;
// In cells of 0.1 m; the blocks share no factor with the patches.
constexpr std::int64_t kBlockX = 701;
constexpr std::int64_t kBlockY = 553;
constexpr std::int64_t kStreet = 140;
constexpr std::int64_t kWall = 2;
constexpr std::int64_t kYard = 70;
constexpr std::int64_t kSlot = 62;  // kerb length of a parked car
constexpr std::uint64_t kStructure = 77;

std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9;
  x = (x ^ (x >> 27)) * 0x94d049bb133111eb;
  return x ^ (x >> 31);
}

std::uint64_t hash(std::uint64_t seed, std::int64_t a, std::int64_t b) {
  return mix(mix(seed + 0x51ed2701 * static_cast<std::uint64_t>(a)) + static_cast<std::uint64_t>(b));
}

/// In [0, 1).
double uniform(std::uint64_t h) { return static_cast<double>(h >> 11) * 0x1p-53; }

/// Smooth noise in [0, 1): hashes at the corners of squares of 3.2 m, bilinear between.
double smooth(std::uint64_t seed, std::int64_t i, std::int64_t j) {
  constexpr std::int64_t kSquare = 32;
  const std::int64_t a = floor_div(i, kSquare);
  const std::int64_t b = floor_div(j, kSquare);
  const double u = static_cast<double>(i - a * kSquare) / kSquare;
  const double v = static_cast<double>(j - b * kSquare) / kSquare;
  const auto at = [&](std::int64_t x, std::int64_t y) { return uniform(hash(seed, x, y)); };
  return (1 - v) * ((1 - u) * at(a, b) + u * at(a + 1, b)) +
         v * ((1 - u) * at(a, b + 1) + u * at(a + 1, b + 1));
}

/// Masses after 1 to 7 measurements of `single`.
constexpr std::array<float, 7> steps(double single) {
  std::array<float, 7> values{};
  double left = 1;
  for (float& v : values) {
    left *= 1 - single;
    v = static_cast<float>(1 - left);
  }
  return values;
}

class CityCursor final : public PatchCursor {
 public:
  CityCursor(const std::vector<PatchIndex>& patches, std::optional<PatchRange> range)
      : patches_(patches), range_(range) {}

  bool next(PatchInfo& out) override {
    while (at_ < patches_.size() && range_ && !range_->contains(patches_[at_])) ++at_;
    if (at_ == patches_.size()) return false;
    LayerInfo info;
    info.patch = patches_[at_];
    info.step = City::kStep;
    info.locator = at_++;
    out.patch = info.patch;
    out.layers.assign(1, info);
    return true;
  }

 private:
  const std::vector<PatchIndex>& patches_;
  std::optional<PatchRange> range_;
  std::size_t at_ = 0;
};

}  // namespace

City::City(const CityOptions& options) : options_(options) {
  options_.seed = mix(options.seed);  // neighbouring numbers are the seeds of different things below
  header_.frame.datum_x_um = 570'000'000'000;
  header_.frame.datum_y_um = 5'360'000'000'000;
  header_.frame.epsg = 32632;
  header_.frame.frame_id = "utm";
  header_.types = TypeTable({LayerType::occupancy()});
  // About 0.55 of the cells are known; grow until they suffice.
  const double patches = static_cast<double>(options.known_cells) / (0.58 * kSide * kSide);
  for (int side = static_cast<int>(std::sqrt(patches)) + 1; !plan(side); ++side) {
    if (side > 4096) throw Error(ErrorCode::kLimit, "a town has at most 4096 x 4096 patches");
  }
}

bool City::plan(int patches_a_side) {
  const int low = -patches_a_side / 2;
  const int shift = static_cast<int>((1 - options_.overlap) * patches_a_side + 0.5);
  std::vector<std::pair<std::uint64_t, PatchIndex>> square;
  for (int y = low; y < low + patches_a_side; ++y) {
    for (int x = low; x < low + patches_a_side; ++x) {
      const PatchIndex patch{x + shift, y};
      square.emplace_back(curve_key(patch), patch);
    }
  }
  std::sort(square.begin(), square.end());
  patches_.clear();
  std::uint64_t missing = options_.known_cells;
  for (const auto& [key, patch] : square) {
    if (missing == 0) break;
    const std::uint64_t known = known_in(patch);
    if (known == 0) continue;
    patches_.push_back(patch);
    known_in_last_ = std::min(known, missing);
    missing -= known_in_last_;
  }
  return missing == 0;
}

City::Kind City::kind_at(std::int64_t i, std::int64_t j) const {
  const std::int64_t block_x = floor_div(i, kBlockX);
  const std::int64_t block_y = floor_div(j, kBlockY);
  const std::int64_t u = i - block_x * kBlockX;
  const std::int64_t v = j - block_y * kBlockY;
  if (u < kStreet || v < kStreet) {
    // Cars stand along the far kerb of both streets; their outline is seen, their inside is not.
    const bool crossing = u < kStreet && v < kStreet;
    const std::int64_t along = v < kStreet ? u : v;
    const std::int64_t across = kStreet - (v < kStreet ? v : u);
    const auto slot = static_cast<std::uint64_t>(along / kSlot) + (v < kStreet ? 1000 : 0);
    if (!crossing && across >= 4 && across < 23 && along % kSlot >= 8 && along % kSlot < 52 &&
        hash(kStructure + slot, block_x, block_y) % 100 < 55) {
      const bool edge = across == 4 || across == 22 || along % kSlot == 8 || along % kSlot == 51;
      return edge ? Kind::kOccupied : Kind::kUnknown;
    }
    // Gaps between rays.
    return hash(options_.seed + 1, i, j) % 64 == 0 ? Kind::kUnknown : Kind::kFree;
  }
  const std::int64_t depth =
      std::min(std::min(u - kStreet, kBlockX - 1 - u), std::min(v - kStreet, kBlockY - 1 - v));
  const std::int64_t segment = (u / 90) * 16 + v / 90;
  const bool open = hash(kStructure + 5000, block_x * 1024 + segment, block_y) % 7 == 0;
  if (open) return depth < kYard ? Kind::kFree : Kind::kUnknown;
  if (depth >= kWall) return Kind::kUnknown;
  return hash(options_.seed + 2, i, j) % 8 == 0 ? Kind::kUnknown : Kind::kOccupied;
}

void City::write_cell(Layer& out, std::size_t at, std::int64_t i, std::int64_t j, Kind kind) const {
  constexpr auto kOccupiedSteps = steps(0.55);
  constexpr auto kFreeSteps = steps(0.3);
  const double coarse = smooth(options_.seed + 3, i, j);
  const double fine = uniform(hash(options_.seed + 4, i, j));
  const bool occupied = kind == Kind::kOccupied;
  if (options_.model == Model::kStepped) {
    const auto seen = static_cast<std::size_t>(std::min(6.0, 5.5 * coarse + 1.5 * fine));
    out.plane(occupied ? 0 : 1)[at] = (occupied ? kOccupiedSteps : kFreeSteps)[seen];
    return;
  }
  const double mass = occupied ? 0.5 + 0.3 * coarse + 0.19 * fine : 0.3 + 0.5 * coarse + 0.19 * fine;
  out.plane(occupied ? 0 : 1)[at] = static_cast<float>(mass);
  // One cell in four also holds a little evidence of the contrary.
  const std::uint64_t other = hash(options_.seed + 5, i, j);
  if (other % 4 == 0) {
    out.plane(occupied ? 1 : 0)[at] = static_cast<float>((1 - mass) * (0.1 + 0.8 * uniform(other)));
  }
}

std::uint64_t City::known_in(PatchIndex patch) const {
  std::uint64_t known = 0;
  for (std::int64_t j = patch.y * kSide; j < (patch.y + 1) * kSide; ++j) {
    for (std::int64_t i = patch.x * kSide; i < (patch.x + 1) * kSide; ++i) {
      known += kind_at(i, j) != Kind::kUnknown;
    }
  }
  return known;
}

Summary City::summary() const {
  Summary s;
  s.patches = patches_.size();
  for (const PatchIndex p : patches_) s.range.add(p);
  Summary::OfType of;
  of.layers = patches_.size();
  of.layers_at[kStep] = patches_.size();
  of.raw_bytes = patches_.size() * static_cast<std::uint64_t>(kSide * kSide) * 2 * sizeof(float);
  s.types.push_back(of);
  return s;
}

std::unique_ptr<PatchCursor> City::patches(const std::optional<PatchRange>& range) const {
  return std::make_unique<CityCursor>(patches_, range);
}

void City::load(const LayerInfo& info, Layer& out) const {
  out.reset(header_.types[0], kStep);
  std::uint64_t left = info.locator + 1 == patches_.size() ? known_in_last_ : out.cells();
  std::size_t at = 0;
  for (std::int64_t b = 0; b < kSide; ++b) {
    for (std::int64_t a = 0; a < kSide; ++a, ++at) {
      const std::int64_t i = info.patch.x * kSide + a;
      const std::int64_t j = info.patch.y * kSide + b;
      const Kind kind = left > 0 ? kind_at(i, j) : Kind::kUnknown;
      if (kind == Kind::kUnknown) continue;
      write_cell(out, at, i, j, kind);
      --left;
    }
  }
}

}  // namespace apgm::bench

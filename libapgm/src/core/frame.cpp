#include "apgm/core/frame.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "apgm/core/error.hpp"
#include "apgm/core/text.hpp"

namespace apgm {
namespace {

constexpr double kMaxCoordinate_m = 4e9;
constexpr std::int64_t kNanoPerMicro = 1000;

std::int64_t to_nanometres(double metres) {
  if (!std::isfinite(metres)) throw Error(ErrorCode::kInvalidArgument, "a coordinate is not a finite number");
  if (std::fabs(metres) > kMaxCoordinate_m) {
    throw Error(ErrorCode::kLimit, "a coordinate lies beyond 4e9 m");
  }
  return std::llrint(metres * 1e9);
}

std::int32_t clamp_index(std::int64_t i) {
  return static_cast<std::int32_t>(std::clamp<std::int64_t>(i, std::numeric_limits<std::int32_t>::min(),
                                                            std::numeric_limits<std::int32_t>::max()));
}

std::int32_t checked_index(std::int64_t i) {
  if (clamp_index(i) != i) throw Error(ErrorCode::kLimit, "a point lies outside all patch indices");
  return static_cast<std::int32_t>(i);
}

/// Cells along one axis that share area with [lo, hi) (nanometres): clamped to [0, side), max < min when
/// none.
void cells_along(std::int64_t origin_nm, std::int64_t edge_nm, int step, std::int64_t lo, std::int64_t hi,
                 std::int32_t& min, std::int32_t& max) {
  // Clamping to the patch first keeps the product below 1e13 * 2^11 < 2^63.
  const std::int64_t from = std::clamp<std::int64_t>(lo - origin_nm, 0, edge_nm);
  const std::int64_t to = std::clamp<std::int64_t>(hi - origin_nm, 0, edge_nm);
  min = static_cast<std::int32_t>(floor_div(from << step, edge_nm));
  max = to > from ? static_cast<std::int32_t>(floor_div((to << step) - 1, edge_nm)) : min - 1;
}

/// Exact: "-0.000001".
std::string metres(std::int64_t um) {
  constexpr std::uint64_t kMicro = 1'000'000;
  const std::uint64_t size = um < 0 ? 0 - static_cast<std::uint64_t>(um) : static_cast<std::uint64_t>(um);
  std::string text = (um < 0 ? "-" : "") + std::to_string(size / kMicro);
  if (size % kMicro == 0) return text;
  const std::string digits = std::to_string(kMicro + size % kMicro).substr(1);
  return text + "." + digits.substr(0, digits.find_last_not_of('0') + 1);
}

}  // namespace

bool PatchRange::meets(const PatchRange& o) const {
  return !empty() && !o.empty() && min.x <= o.max.x && o.min.x <= max.x && min.y <= o.max.y &&
         o.min.y <= max.y;
}

void PatchRange::add(PatchIndex p) { add(PatchRange{p, p}); }

void PatchRange::add(const PatchRange& o) {
  if (o.empty()) return;
  if (empty()) {
    *this = o;
    return;
  }
  min = {std::min(min.x, o.min.x), std::min(min.y, o.min.y)};
  max = {std::max(max.x, o.max.x), std::max(max.y, o.max.y)};
}

bool Frame::CellRange::all(int step) const {
  const std::int32_t last = (1 << step) - 1;
  return min.a == 0 && min.b == 0 && max.a == last && max.b == last;
}

Point Frame::datum_m() const {
  return {static_cast<double>(datum_x_um) / 1e6, static_cast<double>(datum_y_um) / 1e6};
}

Point Frame::origin_m(PatchIndex patch) const { return box_m(patch).min; }

Box Frame::box_m(PatchIndex patch) const { return box_m(PatchRange{patch, patch}); }

Box Frame::box_m(const PatchRange& range) const {
  // Whole micrometres below 2^63, rounded once: 2^31 * 1e10 does not fit, so far corners go through double.
  const auto corner = [&](std::int64_t datum_um, std::int64_t i) {
    const auto edges = static_cast<__int128>(i) * edge_um + datum_um;
    return static_cast<double>(edges) / 1e6;
  };
  return {
      {corner(datum_x_um, range.min.x), corner(datum_y_um, range.min.y)},
      {corner(datum_x_um, std::int64_t{range.max.x} + 1), corner(datum_y_um, std::int64_t{range.max.y} + 1)}};
}

PatchIndex Frame::patch_at(Point p) const { return cell_at(p, 0).patch; }

Frame::Cell Frame::cell_at(Point p, int step) const {
  const std::int64_t edge_nm = edge_um * kNanoPerMicro;
  const std::int64_t x = to_nanometres(p.x_m) - datum_x_um * kNanoPerMicro;
  const std::int64_t y = to_nanometres(p.y_m) - datum_y_um * kNanoPerMicro;
  const std::int64_t ix = floor_div(x, edge_nm);
  const std::int64_t iy = floor_div(y, edge_nm);
  return {{checked_index(ix), checked_index(iy)},
          {static_cast<std::int32_t>(((x - ix * edge_nm) << step) / edge_nm),
           static_cast<std::int32_t>(((y - iy * edge_nm) << step) / edge_nm)}};
}

PatchRange Frame::patches_meeting(const Box& box) const {
  const std::int64_t edge_nm = edge_um * kNanoPerMicro;
  const std::int64_t dx = datum_x_um * kNanoPerMicro;
  const std::int64_t dy = datum_y_um * kNanoPerMicro;
  const std::int64_t x0 = to_nanometres(box.min.x_m), x1 = to_nanometres(box.max.x_m);
  const std::int64_t y0 = to_nanometres(box.min.y_m), y1 = to_nanometres(box.max.y_m);
  if (x1 <= x0 || y1 <= y0) {
    throw Error(ErrorCode::kInvalidArgument, "the box is inverted or empty")
        .hint("a box is XMIN,YMIN,XMAX,YMAX in metres with XMIN < XMAX and YMIN < YMAX");
  }
  return {{clamp_index(floor_div(x0 - dx, edge_nm)), clamp_index(floor_div(y0 - dy, edge_nm))},
          {clamp_index(floor_div(x1 - dx - 1, edge_nm)), clamp_index(floor_div(y1 - dy - 1, edge_nm))}};
}

Frame::CellRange Frame::cells_meeting(PatchIndex patch, int step, const Box& box) const {
  const std::int64_t edge_nm = edge_um * kNanoPerMicro;
  // A box reaches 4e9 m at most: patches beyond cannot meet it, and the products below stay within 63 bits.
  const std::int64_t reach = static_cast<std::int64_t>(4e18) / edge_nm;
  if (std::abs(std::int64_t{patch.x}) > reach || std::abs(std::int64_t{patch.y}) > reach) return {};
  const std::int64_t ox = datum_x_um * kNanoPerMicro + patch.x * edge_nm;
  const std::int64_t oy = datum_y_um * kNanoPerMicro + patch.y * edge_nm;
  CellRange r;
  cells_along(ox, edge_nm, step, to_nanometres(box.min.x_m), to_nanometres(box.max.x_m), r.min.a, r.max.a);
  cells_along(oy, edge_nm, step, to_nanometres(box.min.y_m), to_nanometres(box.max.y_m), r.min.b, r.max.b);
  return r;
}

int Frame::step_for(double cell_m) const {
  if (!(cell_m > 0) || !std::isfinite(cell_m)) {
    throw Error(ErrorCode::kInvalidArgument, "a cell size must be a positive number of metres");
  }
  for (int step = 0; step <= kMaxStep; ++step) {
    if (this->cell_m(step) <= cell_m * (1 + 1e-9)) return step;
  }
  throw Error(ErrorCode::kLimit, "the cell size is finer than the patch edge / 2^11")
      .hint("choose a smaller edge or a larger cell");
}

void Frame::check() const {
  constexpr std::int64_t kMaxDatum_um = 1'000'000'000'000'000;
  if (edge_um < 1'000 || edge_um > 10'000'000'000) {
    throw Error(ErrorCode::kLimit, "the patch edge must lie between 0.001 m and 10000 m");
  }
  const auto within = [](std::int64_t datum_um) {
    return datum_um >= -kMaxDatum_um && datum_um <= kMaxDatum_um;
  };
  if (!within(datum_x_um) || !within(datum_y_um)) {
    throw Error(ErrorCode::kLimit, "the datum must lie within 1e9 m");
  }
  if (epsg && (*epsg < 1 || *epsg > 999'999)) {
    throw Error(ErrorCode::kInvalidArgument, "an EPSG code lies between 1 and 999999");
  }
  if (frame_id.empty() || frame_id.size() > 255 || !is_plain_text(frame_id)) {
    throw Error(ErrorCode::kInvalidArgument,
                "a frame id is 1 to 255 bytes of UTF-8 without control characters");
  }
}

std::string difference(const Frame& a, const Frame& b) {
  std::string text;
  const auto differ = [&](bool is_other, const char* what, const auto& value) {
    if (!is_other) return;
    text +=
        (text.empty() ? "" : "; ") + std::string(what) + " differ (" + value(a) + " and " + value(b) + ")";
  };
  differ(a.frame_id != b.frame_id, "frame ids", [](const Frame& f) { return "'" + f.frame_id + "'"; });
  differ(a.epsg != b.epsg, "EPSG codes",
         [](const Frame& f) { return f.epsg ? std::to_string(*f.epsg) : std::string("none"); });
  differ(a.edge_um != b.edge_um, "patch edges", [](const Frame& f) { return metres(f.edge_um) + " m"; });
  differ(a.datum_x_um != b.datum_x_um || a.datum_y_um != b.datum_y_um, "datums",
         [](const Frame& f) { return metres(f.datum_x_um) + "," + metres(f.datum_y_um) + " m"; });
  return text;
}

std::int64_t to_micrometres(double metres) {
  if (!std::isfinite(metres)) throw Error(ErrorCode::kInvalidArgument, "a length is not a finite number");
  if (std::fabs(metres) > 1e9) throw Error(ErrorCode::kLimit, "a length lies beyond 1e9 m");
  return std::llrint(metres * 1e6);
}

namespace {

using CurveTable = std::array<std::array<std::uint16_t, 256>, 4>;

/// State machine of the Hilbert curve, four levels at once: for each state, four bits of x and four bits of y
/// the eight bits of the key, and above them the next state. State 0 runs (0,0) (1,0) (1,1) (0,1) on the
/// finest level of an even number of levels.
constexpr CurveTable curve_table() {
  constexpr std::array<std::array<std::uint8_t, 4>, 4> kDigit{{
      {0, 1, 3, 2},  // quadrant = 2 * x + y
      {0, 3, 1, 2},
      {2, 1, 3, 0},
      {2, 3, 1, 0},
  }};
  constexpr std::array<std::array<std::uint8_t, 4>, 4> kNext{{
      {1, 0, 2, 0},
      {0, 3, 1, 1},
      {2, 2, 0, 3},
      {3, 1, 3, 2},
  }};
  CurveTable table{};
  for (unsigned start = 0; start < 4; ++start) {
    for (unsigned bits = 0; bits < 256; ++bits) {
      unsigned key = 0, state = start;
      for (int bit = 3; bit >= 0; --bit) {
        const unsigned q = (bits >> (bit + 4) & 1u) << 1 | (bits >> bit & 1u);
        key = key << 2 | kDigit[state][q];
        state = kNext[state][q];
      }
      table[start][bits] = static_cast<std::uint16_t>(state << 8 | key);
    }
  }
  return table;
}

constexpr CurveTable kCurve = curve_table();

struct CurvePlace {
  std::uint64_t key = 0;
  unsigned state = 0;
};

/// Goes on from `at` by the bits [low, high) of x and y, a multiple of four.
constexpr CurvePlace walk_curve(CurvePlace at, std::uint32_t x, std::uint32_t y, int high, int low) {
  for (int bit = high - 4; bit >= low; bit -= 4) {
    const std::uint16_t step = kCurve[at.state][(x >> bit & 15u) << 4 | (y >> bit & 15u)];
    at.key = at.key << 8 | (step & 0xffu);
    at.state = step >> 8;
  }
  return at;
}

/// The upper half of the way to patches near the origin, by the signs of y and x: most there are.
constexpr std::array<CurvePlace, 4> kNear{
    walk_curve({}, 0x7fff0000u, 0x7fff0000u, 32, 16), walk_curve({}, 0x7fff0000u, 0x80000000u, 32, 16),
    walk_curve({}, 0x80000000u, 0x7fff0000u, 32, 16), walk_curve({}, 0x80000000u, 0x80000000u, 32, 16)};

}  // namespace

std::uint64_t curve_key(PatchIndex patch) {
  const std::uint32_t x = static_cast<std::uint32_t>(patch.x) ^ 0x80000000u;
  const std::uint32_t y = static_cast<std::uint32_t>(patch.y) ^ 0x80000000u;
  const std::uint32_t right = (x >> 16) - 0x7fffu, up = (y >> 16) - 0x7fffu;
  if (right > 1 || up > 1) return walk_curve({}, x, y, 32, 0).key;
  return walk_curve(kNear[right << 1 | up], x, y, 16, 0).key;
}

}  // namespace apgm

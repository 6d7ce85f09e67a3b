#include "observe/segment_walk.hpp"

#include <cassert>

namespace apgm::observe {
namespace {

/// Goes from cell to cell without branches: which way a cell is left is as good as random.
class CellStepper {
 public:
  /// @param g  (b + 1) du - (a + 1) dv of the first cell
  CellStepper(CellIndex first, const WalkAxis& x, const WalkAxis& y, std::int64_t g, std::int64_t floor,
              std::int64_t ceil)
      : at_(first),
        right_(x.direction()),
        up_(y.direction()),
        du_(x.length()),
        dv_(y.length()),
        above_(g - floor - 1),
        slack_(ceil - floor - 2) {}

  CellIndex at() const { return at_; }

  /// Writes cells until one would lie in column stop.a or row stop.b.
  /// @tparam kTies  the segment may pass through corners
  template <bool kTies>
  CellIndex* run(CellIndex stop, CellIndex* out) {
    do {
      *out++ = at_;
      advance<kTies>();
    } while ((at_.a != stop.a) & (at_.b != stop.b));
    return out;
  }

  /// Writes cells until `last` is written.
  CellIndex* run_to(CellIndex last, CellIndex* out) {
    *out++ = at_;
    while ((at_.a != last.a) | (at_.b != last.b)) {
      advance<true>();
      *out++ = at_;
    }
    return out;
  }

 private:
  template <bool kTies>
  void advance() {
    // All ones if g <= floor, and if g >= ceil.
    const std::int64_t along_y = above_ >> 63;
    const std::int64_t along_x = kTies ? (slack_ - above_) >> 63 : ~along_y;
    at_.a += right_ & static_cast<std::int32_t>(along_x);
    at_.b += up_ & static_cast<std::int32_t>(along_y);
    above_ += kTies ? (du_ & along_y) - (dv_ & along_x) : ((du_ + dv_) & along_y) - dv_;
  }

  CellIndex at_;
  std::int32_t right_, up_;
  std::int64_t du_, dv_;
  std::int64_t above_;  // g - floor - 1
  std::int64_t slack_;
};

}  // namespace

WalkAxis::WalkAxis(std::int64_t from_nm, std::int64_t to_nm, std::int64_t edge_nm)
    : edge_(edge_nm), length_(to_nm - from_nm), mirrored_(length_ < 0) {
  patch_ = floor_div(from_nm, edge_);
  last_patch_ = floor_div(to_nm, edge_);
  start_ = from_nm - patch_ * edge_;
  end_ = to_nm - last_patch_ * edge_;
  if (!mirrored_) return;
  length_ = -length_;
  patch_ = -patch_ - 1;
  last_patch_ = -last_patch_ - 1;
  start_ = edge_ - start_;
  end_ = edge_ - end_;
}

bool WalkAxis::undo_overshoot() {
  if (patch_ <= last_patch_) return false;
  patch_ = last_patch_;
  return true;
}

SegmentWalk::SegmentWalk(GridPoint from, GridPoint to, std::int64_t edge_nm)
    : edge_(edge_nm), x_(from.x, to.x, edge_nm), y_(from.y, to.y, edge_nm) {
  assert(x_.length() <= kMaxLength_nm && y_.length() <= kMaxLength_nm);
  const __int128 c =
      static_cast<__int128>(y_.start()) * x_.length() - static_cast<__int128>(x_.start()) * y_.length();
  q_ = static_cast<std::int64_t>(c / edge_);
  rest_ = static_cast<std::int64_t>(c % edge_);
  if (rest_ < 0) {
    rest_ += edge_;
    --q_;
  }
}

SegmentWalk::Bounds SegmentWalk::bounds(int step) const {
  const std::int64_t scaled = rest_ << step;
  const std::int64_t floor = q_ * (std::int64_t{1} << step) + scaled / edge_;
  return {floor, floor + (scaled % edge_ != 0)};
}

SegmentWalk::Cell SegmentWalk::entry(int step, const Bounds& c) const {
  Cell at{0, 0};
  // Where u = 0, C = v du; where v = 0, C = -u dv.
  if (entry_ == Entry::kStart) at = {x_.first_cell(step), y_.first_cell(step)};
  if (entry_ == Entry::kAlongX) at.b = floor_div(c.floor, x_.length());
  if (entry_ == Entry::kAlongY) at.a = floor_div(-c.ceil, y_.length());
  // A mirrored axis that ends on the edge of a cell does not enter the next one.
  if (x_.in_last_patch()) at.a = std::min(at.a, x_.end_cell(step));
  if (y_.in_last_patch()) at.b = std::min(at.b, y_.end_cell(step));
  return at;
}

std::span<const CellIndex> SegmentWalk::cross(int step, CellIndex* cells) {
  const Bounds c = bounds(step);
  const Cell at = entry(step, c);
  CellIndex* const end = in_last_patch() ? cross_last(step, at, c, cells) : cross_whole(step, at, c, cells);
  assert(end <= cells + kMaxCells);
  return {cells, end};
}

CellIndex* SegmentWalk::cross_whole(int step, Cell at, const Bounds& c, CellIndex* out) {
  const std::int32_t side = 1 << step;
  const CellIndex stop = real({side, side}, step);
  CellStepper cell(real(at, step), x_, y_, (at.b + 1) * x_.length() - (at.a + 1) * y_.length(), c.floor,
                   c.ceil);
  out = c.floor == c.ceil ? cell.run<true>(stop, out) : cell.run<false>(stop, out);
  leave(cell.at().a == stop.a, cell.at().b == stop.b);
  return out;
}

void SegmentWalk::leave(bool along_x, bool along_y) {
  if (along_x) x_.next_patch();
  if (along_y) y_.next_patch();
  if (along_x && x_.undo_overshoot()) along_x = false;
  if (along_y && y_.undo_overshoot()) along_y = false;
  if (along_x) q_ += y_.length();
  if (along_y) q_ -= x_.length();
  entry_ = along_x && along_y ? Entry::kAlongBoth : along_x ? Entry::kAlongX : Entry::kAlongY;
}

CellIndex* SegmentWalk::cross_last(int step, Cell at, const Bounds& c, CellIndex* out) const {
  const Cell end{x_.end_cell(step), y_.end_cell(step)};
  const Cell before{std::max(at.a, x_.cell_before_end(step)), std::max(at.b, y_.cell_before_end(step))};
  CellStepper cell(real(at, step), x_, y_, (at.b + 1) * x_.length() - (at.a + 1) * y_.length(), c.floor,
                   c.ceil);
  out = cell.run_to(real(before, step), out);
  if (end.a != before.a || end.b != before.b) *out++ = real(end, step);
  return out;
}

}  // namespace apgm::observe

#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "apgm/core/frame.hpp"
#include "observe/grid_point.hpp"

namespace apgm::observe {

/// One coordinate of a walk. Where the segment runs towards lower coordinates the axis is mirrored, so that
/// cells are always counted upwards: cell k of a patch then spans (k s, (k + 1) s] instead of
/// [k s, (k + 1) s). Either way cell k is entered at k s.
class WalkAxis {
 public:
  WalkAxis(std::int64_t from_nm, std::int64_t to_nm, std::int64_t edge_nm);

  std::int64_t length() const { return length_; }
  /// Start of the segment, counted from the lower side of its patch: 0 .. edge.
  std::int64_t start() const { return start_; }
  bool in_last_patch() const { return patch_ == last_patch_; }
  std::int32_t patch() const { return static_cast<std::int32_t>(mirrored_ ? -patch_ - 1 : patch_); }
  void next_patch() { ++patch_; }
  /// True, and undone, if the last next_patch left the patch of the end point.
  bool undo_overshoot();

  std::int64_t first_cell(int step) const { return cell_of(start_, step); }
  std::int64_t end_cell(int step) const { return cell_of(end_, step); }
  /// Last cell entered before the end of the segment; -1 if none of its patch is.
  std::int64_t cell_before_end(int step) const { return cell_below(end_, step); }
  /// Cell as a layer counts it, and what is added to it from cell to cell.
  std::int32_t real_cell(std::int64_t cell, int step) const {
    return static_cast<std::int32_t>(mirrored_ ? (std::int64_t{1} << step) - 1 - cell : cell);
  }
  std::int32_t direction() const { return mirrored_ ? -1 : 1; }

 private:
  std::int64_t cell_of(std::int64_t nm, int step) const {
    return mirrored_ ? cell_below(nm, step) : (nm << step) / edge_;
  }
  std::int64_t cell_below(std::int64_t nm, int step) const { return floor_div((nm << step) - 1, edge_); }

  std::int64_t edge_, length_, patch_, last_patch_, start_, end_;
  bool mirrored_;
};

/// Walks the cells of one segment, patch by patch, each patch with the step it is asked for.
///
/// With u, v the axes of the walk, lengths du, dv and cells of side s, cell (a, b) is left along v before u
/// if s ((b + 1) du - (a + 1) dv) < C, along both at once if equal, where C = v0 du - u0 dv is a constant of
/// the segment seen from the corner of the patch. C / s is kept as the integers q, rest with C = q edge +
/// rest, so that the cells need additions and comparisons of 64 bits only.
class SegmentWalk {
 public:
  /// Longest segment along an axis: 1000 km. Longer ones would not fit 64 bits.
  static constexpr std::int64_t kMaxLength_nm = 1'000'000'000'000'000;
  /// Most cells a segment crosses in one patch.
  static constexpr std::size_t kMaxCells = (std::size_t{2} << kMaxStep) + 2;

  /// REQUIRES: no axis longer than kMaxLength_nm.
  SegmentWalk(GridPoint from, GridPoint to, std::int64_t edge_nm);

  PatchIndex patch() const { return {x_.patch(), y_.patch()}; }
  bool in_last_patch() const { return x_.in_last_patch() && y_.in_last_patch(); }
  /// The cells of the present patch at `step`; goes on to the next patch.
  /// @param cells  kMaxCells of room
  std::span<const CellIndex> cross(int step, CellIndex* cells);

 private:
  struct Cell {
    std::int64_t a, b;
  };
  struct Bounds {  // floor and ceil of C / s
    std::int64_t floor, ceil;
  };
  enum class Entry : std::uint8_t { kStart, kAlongX, kAlongY, kAlongBoth };

  Bounds bounds(int step) const;
  Cell entry(int step, const Bounds& c) const;
  CellIndex* cross_whole(int step, Cell at, const Bounds& c, CellIndex* out);
  CellIndex* cross_last(int step, Cell at, const Bounds& c, CellIndex* out) const;
  /// Goes to the next patch along the axes whose border was met.
  void leave(bool along_x, bool along_y);
  CellIndex real(Cell c, int step) const { return {x_.real_cell(c.a, step), y_.real_cell(c.b, step)}; }

  std::int64_t edge_;
  WalkAxis x_, y_;
  std::int64_t q_ = 0, rest_ = 0;
  Entry entry_ = Entry::kStart;
};

}  // namespace apgm::observe

#pragma once

#include <compare>
#include <cstdint>
#include <optional>
#include <string>

namespace apgm {

/// Highest resolution step: a layer has at most 2^11 x 2^11 cells.
inline constexpr int kMaxStep = 11;

/// Index (i_x, i_y) of a patch (paper, Sec. III-A).
struct PatchIndex {
  std::int32_t x = 0;
  std::int32_t y = 0;
  friend auto operator<=>(const PatchIndex&, const PatchIndex&) = default;
};

/// Index (a, b) of a cell in a layer of step r: 0 <= a, b < 2^r, a along x, b along y.
struct CellIndex {
  std::int32_t a = 0;
  std::int32_t b = 0;
  friend auto operator<=>(const CellIndex&, const CellIndex&) = default;
};

/// A point in metres of the map's coordinate reference system.
struct Point {
  double x_m = 0;
  double y_m = 0;
  friend bool operator==(const Point&, const Point&) = default;
};

/// A half-open box [min, max) in metres of the map's coordinate reference system.
struct Box {
  Point min;
  Point max;
  friend bool operator==(const Box&, const Box&) = default;
};

/// An inclusive range of patch indices. Empty when max < min on an axis.
struct PatchRange {
  PatchIndex min{0, 0};
  PatchIndex max{-1, -1};
  bool empty() const { return max.x < min.x || max.y < min.y; }
  bool contains(PatchIndex p) const { return p.x >= min.x && p.x <= max.x && p.y >= min.y && p.y <= max.y; }
  bool meets(const PatchRange& o) const;
  /// Grows to hold `p`.
  void add(PatchIndex p);
  void add(const PatchRange& o);
  friend bool operator==(const PatchRange&, const PatchRange&) = default;
};

/// Where a map lies and how it is divided (paper, Sec. III-A): patch (i_x, i_y) has its lower-left corner at
/// d_g + e (i_x, i_y), cell (a, b) of a layer of step r at d_p + (e / 2^r) (a, b).
///
/// Datum and edge are whole micrometres, so that "the same grid" and "a whole number of cells apart" are
/// exact questions. Points are taken to the nearest nanometre before they are divided; from there on all
/// division is exact floor division: 0.3 m lies in cell 3 of a 0.1 m grid, -1e-9 m in cell -1.
struct Frame {
  std::int64_t datum_x_um = 0;  ///< d_g, x; |d| <= 1e15 (1e9 m)
  std::int64_t datum_y_um = 0;
  std::int64_t edge_um = 12'800'000;  ///< e; 1e3 (1 mm) to 1e10 (10 km)
  std::optional<std::int32_t> epsg;   ///< nullopt: said to be unknown
  std::string frame_id = "map";       ///< name of the coordinate frame; printable UTF-8, at most 255 bytes

  double edge_m() const { return static_cast<double>(edge_um) / 1e6; }
  Point datum_m() const;
  /// Side of a cell at `step`, in metres.
  double cell_m(int step) const { return edge_m() / static_cast<double>(1 << step); }
  /// Lower-left corner of a patch.
  Point origin_m(PatchIndex patch) const;
  /// The area of a patch, and of all patches of a range.
  Box box_m(PatchIndex patch) const;
  Box box_m(const PatchRange& range) const;

  /// Patch that holds `p`. @throws Error{kInvalidArgument} if `p` is not finite, {kLimit} if outside all
  /// indices.
  PatchIndex patch_at(Point p) const;
  /// Patch and cell that hold `p` at `step`.
  struct Cell {
    PatchIndex patch;
    CellIndex cell;
  };
  Cell cell_at(Point p, int step) const;

  /// Patches that share area with the half-open box; indices are clamped to the int32 range.
  /// @throws Error{kInvalidArgument} if the box is inverted, empty, or not finite
  PatchRange patches_meeting(const Box& box) const;

  /// Cells of `patch` at `step` that share area with the box, inclusive; empty if none.
  struct CellRange {
    CellIndex min{0, 0};
    CellIndex max{-1, -1};
    bool empty() const { return max.a < min.a || max.b < min.b; }
    bool all(int step) const;
  };
  CellRange cells_meeting(PatchIndex patch, int step, const Box& box) const;

  /// r_req = ceil(log2(e / cell_size)): the coarsest step whose cells are no larger than `cell_m` (within
  /// 1e-9).
  /// @throws Error{kInvalidArgument} if not a positive number, {kLimit} if finer than step 11
  int step_for(double cell_m) const;

  /// @throws Error{kInvalidArgument|kLimit} if a member is out of its range
  void check() const;

  friend bool operator==(const Frame&, const Frame&) = default;
};

/// What two frames differ in, for messages: "frame ids differ ('map' and 'odom'); patch edges differ (12.8 m
/// and 25.6 m)", with the values of `a` first. Empty if they are equal.
std::string difference(const Frame& a, const Frame& b);

/// Micrometres nearest to `metres`. @throws Error{kInvalidArgument} if not finite, {kLimit} beyond +-1e9 m
std::int64_t to_micrometres(double metres);

/// Quotient rounded to minus infinity, exact for all arguments; `divisor` > 0.
constexpr std::int64_t floor_div(std::int64_t value, std::int64_t divisor) {
  const std::int64_t q = value / divisor;
  return q - ((value % divisor != 0) && (value < 0));
}

/// Position of a patch on the Hilbert curve over (x + 2^31, y + 2^31): the order of patches in files and
/// streams. A k x k box of patches touches about k runs of keys, at any place and for any extent of the map.
std::uint64_t curve_key(PatchIndex patch);

}  // namespace apgm

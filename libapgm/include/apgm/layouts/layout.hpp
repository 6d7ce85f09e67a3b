#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "apgm/core/map.hpp"

namespace apgm {

/// All information of a place in one cell, as the fixed layouts of the literature store it: the channels of
/// all types one after the other (paper, Sec. V: 2 of occupancy and 4 of semantics, 6 values).
class CellSchema {
 public:
  /// @throws Error{kInvalidArgument} for a table without types
  explicit CellSchema(TypeTable types);
  const TypeTable& types() const { return types_; }
  /// Values a cell.
  int values() const { return static_cast<int>(background_.size()); }
  /// Position of the first channel of a type.
  int first(TypeId type) const { return first_[type]; }
  /// A cell without data.
  const std::vector<float>& background() const { return background_; }
  /// True if the cell holds data in any channel, or in those of a type: other bits than the background's.
  bool is_known(const float* cell) const;
  bool is_known(const float* cell, TypeId type) const;

 private:
  TypeTable types_;
  std::vector<int> first_;
  std::vector<float> background_;
};

/// What a layout holds now.
struct Footprint {
  std::uint64_t cells = 0;        ///< allocated
  std::uint64_t values = 0;       ///< floats of these cells
  std::uint64_t known_cells = 0;  ///< cells with data in any channel
  /// Values and all around them: tables, nodes, buckets, allocator headers (docs/layouts.md). Not the object
  /// itself and its schema.
  std::uint64_t allocated_bytes = 0;

  double fill_rate() const {
    return cells == 0 ? 0.0 : static_cast<double>(known_cells) / static_cast<double>(cells);
  }
  std::uint64_t value_bytes() const { return values * sizeof(float); }
};

/// A half-open rectangle [x0, x1) x [y0, y1) in whole micrometres of the map's CRS.
struct Area {
  std::int64_t x0_um = 0, y0_um = 0, x1_um = 0, y1_um = 0;
  bool empty() const { return x1_um <= x0_um || y1_um <= y0_um; }
  bool meets(const Area& o) const { return !shared(o).empty(); }
  Area shared(const Area& o) const;
  friend bool operator==(const Area&, const Area&) = default;
};

/// Area of a patch. @throws Error{kLimit} if it reaches beyond 4e9 m
Area area_of(const Frame& frame, PatchIndex patch);

/// A rectangle of equal cells that a layout stores row by row.
struct CellBlock {
  std::int64_t x_um = 0, y_um = 0;            ///< lower-left corner, in the map's CRS
  std::int64_t cell_x_um = 0, cell_y_um = 0;  ///< sides of a cell
  int columns = 0, rows = 0;
  std::int64_t row_stride = 0;   ///< floats from one row to the next
  const float* cells = nullptr;  ///< CellSchema::values() floats a cell; x fastest

  Area area() const { return {x_um, y_um, x_um + columns * cell_x_um, y_um + rows * cell_y_um}; }
};

struct LayoutDescription;

/// A way of storing cells that an adaptive patched grid map is compared with. Really stores; nothing is
/// estimated. Cells have sides of whole micrometres and are aligned to multiples of their size, counted from
/// the datum of `frame()`. Points go to the cell that holds them, as in Frame.
///
/// Members that take a point throw Error{kInvalidArgument} if it is not finite and {kLimit} beyond 4e9 m.
/// Thread rule: const members from any thread, others from one; a layout and its snapshots count as one.
class Layout {
 public:
  virtual ~Layout() = default;
  virtual std::string name() const = 0;
  virtual const CellSchema& schema() const = 0;
  /// Datum and CRS; the edge counts for sub-maps only.
  virtual const Frame& frame() const = 0;

  /// The vehicle is here: a layout that moves shifts by whole cells of its coarsest size; what leaves is
  /// lost, what enters is without data, what changes its cell size is resampled by its types' policies.
  virtual void move_to(Point vehicle) = 0;
  /// The values of the cell that holds `p`; nullptr if none is allocated there.
  virtual const float* find(Point p) const = 0;
  /// The same; a layout that grows makes the cell. nullptr outside the layout.
  virtual float* insert(Point p) = 0;
  /// Makes what must exist for data in `area`; layouts of fixed size do nothing.
  /// @throws Error{kLimit} if that would be too much
  virtual void reserve(const Area& area) = 0;
  /// All allocated cells; blocks do not overlap. In the order of the container, which is not a contract.
  virtual void for_each_block(const std::function<void(const CellBlock&)>& visit) const = 0;
  /// The blocks that share area with `area`, to be written: `visit(block, cells)`.
  virtual void edit_blocks(const Area& area, const std::function<void(const CellBlock&, float*)>& visit) = 0;
  /// An independent layout with the same cells. Tiles with copy on write are shared until either writes.
  virtual std::unique_ptr<Layout> snapshot() const = 0;
  virtual Footprint footprint() const = 0;
  /// What makes another layout of this kind at this place (description.hpp).
  virtual LayoutDescription describe() const = 0;
};

/// Brings the cells of a map into a layout: where the map holds data of a type, the layout's cells take the
/// map's layer resampled to their size, others stay as they are. Cells of the map outside the layout are
/// lost, so are stamps.
///
/// Square cells of edge / 2^r on a common datum get the bits of resample(). Other cells are gathered by area
/// (regrid()); cells that are not square are merged from, or are parts of, squares of their shorter side.
///
/// @throws Error{kIncompatible} if the schema lacks a type of the map; those of `map` and Layout::reserve
void fill(Layout& layout, const PatchSource& map);

/// The cells of a layout as a map on `frame`: per patch and type the finest cells with data that reach into
/// it decide the step, coarser ones are split by the type's policy. Without vacuous layers and stamps.
/// @throws Error{kIncompatible} if the cells do not fall on those of `frame`
Map to_map(const Layout& layout, const Frame& frame);

}  // namespace apgm

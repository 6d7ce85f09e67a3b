#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "apgm/core/source.hpp"
#include "apgm/ops/run.hpp"

namespace apgm {

struct Colour {
  std::uint8_t red = 0;
  std::uint8_t green = 0;
  std::uint8_t blue = 0;
  friend bool operator==(const Colour&, const Colour&) = default;
};

/// Pixels in rows from the top-left corner, which is north-west: y of the map points up. Four bytes a pixel:
/// red, green, blue, alpha.
struct Raster {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgba;

  bool empty() const { return width == 0 || height == 0; }
  /// Colour at `column` from the left and `row` from the top.
  Colour at(int column, int row) const {
    const std::uint8_t* p = rgba.data() + (static_cast<std::size_t>(row) * width + column) * 4;
    return {p[0], p[1], p[2]};
  }
};

/// How a cell becomes a colour. Cells outside all patches look like cells without data.
enum class Colormap : std::uint8_t {
  kDefault,     ///< belief for occupancy, categories for other evidence, ramp for real channels
  kBelief,      ///< occupancy: dark, light and blue-grey mixed by m(O), m(F), m(Omega)
  kEvidence,    ///< occupancy: vermilion, blue and near-white by the masses; min(m(O), m(F)) twice as yellow
  kGrey,        ///< occupancy as nav2 maps show it: BetP(O) >= 0.65 is 0, <= 0.25 is 254, else 205
  kCategories,  ///< evidence: one colour a hypothesis, light grey for Omega, mixed by the masses
  kRamp,        ///< real channels: violet to yellow from the least to the greatest value drawn
};
std::string_view to_string(Colormap colormap);
std::optional<Colormap> colormap_from(std::string_view name);

struct LegendEntry {
  std::string label;
  Colour colour;
  friend bool operator==(const LegendEntry&, const LegendEntry&) = default;
};

/// What the colours mean, for a picture.
struct Legend {
  std::vector<LegendEntry> entries;  ///< separate things
  std::vector<LegendEntry> scale;    ///< samples of one continuous scale at equal distances; empty: none
};

struct RenderOptions {
  TypeId type = 0;                ///< the layer to draw
  int channel = 0;                ///< of real channels, the one to draw
  std::optional<Box> area;        ///< snapped outwards to whole pixels; empty: all patches of the map
  std::optional<double> pixel_m;  ///< taken down to the next size that fits the cells; empty: by max_side
  Colormap colormap = Colormap::kDefault;
  int max_side = 2048;  ///< without pixel_m: pixels grow from the finest cell until the longer side fits
  std::uint64_t max_pixels = std::uint64_t{1} << 26;
  int min_patch_px = 16;  ///< patch squares are listed if a patch is at least this wide
};

/// A raster and what it shows.
struct Rendering {
  /// Upper-left pixel of a patch that holds the layer; may lie outside the raster.
  struct Square {
    int left = 0;
    int top = 0;
    friend bool operator==(const Square&, const Square&) = default;
  };

  Raster raster;             ///< empty if the map holds no such layer
  Box area;                  ///< of the raster, in metres
  double pixel_m = 0;        ///< side of a pixel
  std::uint64_t layers = 0;  ///< that were drawn
  Legend legend;
  int patch_px = 0;             ///< side of a patch in pixels; 0 if below RenderOptions::min_patch_px
  std::vector<Square> patches;  ///< in key order; empty if patch_px is 0
};

/// Draws one layer type of a map as seen from above. Reads no file, knows no file format.
///
/// A pixel is a cell times or divided by a whole number, and lies on the map's grid: every cell covers whole
/// pixels, or every pixel whole cells. Where pixels are coarser than cells, the cells are merged by the
/// type's own policy (resample; over patches too, in steps of 2 x 2), so no occupied cell vanishes in a small
/// picture. Where they are finer, cells are drawn as squares, unchanged.
///
/// Guarantees: same bytes for any thread count and any ISA. Patches are streamed; memory is the raster, two
/// layers a thread and a small batch of patch entries.
///
/// @throws Error{kInvalidArgument} if the type, channel, colormap, area or pixel size cannot be used;
///         {kLimit} if the raster would exceed max_pixels, 65 535 pixels a side or run.max_memory_bytes;
///         {kCancelled}; whatever the source throws, for the first such layer in key order
Rendering render(const PatchSource& source, const RenderOptions& options, const RunOptions& run = {});

}  // namespace apgm

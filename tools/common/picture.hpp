#pragma once

#include <string>
#include <vector>

#include "apgm/format/output_file.hpp"
#include "apgm/ops/render.hpp"
#include "tools/common/conflict_picture.hpp"

namespace apgm::tools {

struct PictureText {
  std::string title;                ///< what is shown, e.g. the name of a file
  std::vector<std::string> facts;   ///< joined by commas below the title
  std::string up = "N";             ///< where the upper border looks to: "N", or "y" where north is not known
  std::string no_data = "no data";  ///< shown in place of an empty raster
};

/// A length that is 1, 2 or 5 times a power of ten metres, and the same in whole pixels.
struct ScaleBar {
  double length_m = 0;
  int length_px = 0;
  std::string label;  ///< "20 m", "5 km"
};
/// The longest such length that takes at most `most_px` pixels (>= 16) of `pixel_m` metres.
ScaleBar scale_bar(double pixel_m, int most_px);

/// Composes a picture for people: the raster (north up, unscaled), title and facts above it, the coordinates
/// of its lower-left and upper-right corner, a scale bar, an arrow up, a legend below it, and thin squares
/// around the patches that `rendering` lists. At least 360 pixels wide, so that no text is cut or overlaps;
/// long titles and facts are wrapped. Uses built-in fonts: the same pixels on every machine. Text that is not
/// ASCII shows as '?'.
///
/// An empty raster gives a valid picture that says `text.no_data`.
Raster compose(const Rendering& rendering, const PictureText& text);

/// Writes an opaque PNG, the same bytes for the same pixels and versions of libgd and zlib. Does not commit.
/// @throws Error{kOutput}; {kLimit} if the picture is empty or larger than libgd can hold
void write_png(const Raster& raster, OutputFile& out);

}  // namespace apgm::tools

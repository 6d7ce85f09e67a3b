#pragma once

#include <gd.h>
#include <gdfontmb.h>
#include <gdfonts.h>

namespace apgm::tools {

/// What pictures are drawn with. libgd is loaded when the first one is made: with the fifty libraries behind
/// it it took ten milliseconds of every start.
struct Gd {
  decltype(&gdImageCreateTrueColor) create = nullptr;
  decltype(&gdImageDestroy) destroy = nullptr;
  decltype(&gdImageFilledRectangle) fill = nullptr;
  decltype(&gdImageRectangle) frame = nullptr;
  decltype(&gdImageSetClip) set_clip = nullptr;
  decltype(&gdImageSetPixel) set_pixel = nullptr;
  decltype(&gdImageChar) write_char = nullptr;
  decltype(&gdFontGetSmall) small_font = nullptr;
  decltype(&gdFontGetMediumBold) bold_font = nullptr;
  decltype(&gdImagePngPtrEx) encode_png = nullptr;
  decltype(&gdFree) free = nullptr;
};

/// The same at every call; any thread. @throws Error{kUnsupported} where libgd is not installed
const Gd& gd();

}  // namespace apgm::tools

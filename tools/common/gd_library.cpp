#include "tools/common/gd_library.hpp"

#include <dlfcn.h>

#include <string>

#include "apgm/core/error.hpp"

namespace apgm::tools {
namespace {

[[noreturn]] void fail() {
  const char* why = ::dlerror();
  throw Error(ErrorCode::kUnsupported,
              std::string("pictures cannot be drawn: ") + (why == nullptr ? "" : why))
      .hint("install libgd");
}

template <typename Function>
void find(void* library, const char* name, Function& function) {
  function = reinterpret_cast<Function>(::dlsym(library, name));
  if (function == nullptr) fail();
}

Gd load() {
  void* library = ::dlopen(APGM_GD_LIBRARY, RTLD_NOW | RTLD_LOCAL);  // stays: what it gave is used to the end
  if (library == nullptr) fail();
  Gd gd;
  find(library, "gdImageCreateTrueColor", gd.create);
  find(library, "gdImageDestroy", gd.destroy);
  find(library, "gdImageFilledRectangle", gd.fill);
  find(library, "gdImageRectangle", gd.frame);
  find(library, "gdImageSetClip", gd.set_clip);
  find(library, "gdImageSetPixel", gd.set_pixel);
  find(library, "gdImageChar", gd.write_char);
  find(library, "gdFontGetSmall", gd.small_font);
  find(library, "gdFontGetMediumBold", gd.bold_font);
  find(library, "gdImagePngPtrEx", gd.encode_png);
  find(library, "gdFree", gd.free);
  return gd;
}

}  // namespace

const Gd& gd() {
  static const Gd loaded = load();
  return loaded;
}

}  // namespace apgm::tools

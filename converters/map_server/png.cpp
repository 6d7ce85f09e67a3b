#include "converters/map_server/png.hpp"

#include <png.h>

#include <array>
#include <cstring>
#include <exception>
#include <vector>

#include "apgm/core/error.hpp"
#include "converters/map_server/picture.hpp"

namespace apgm::converters {
namespace {

/// What libpng's callbacks see: no exception may pass its frames, no destructor may be jumped over.
struct Context {
  std::array<char, 128> message{};
  std::string_view input;
  std::size_t at = 0;
  OutputFile* output = nullptr;
  std::exception_ptr thrown;
};

void on_error(png_structp png, png_const_charp message) {
  auto* context = static_cast<Context*>(png_get_error_ptr(png));
  std::strncpy(context->message.data(), message, context->message.size() - 1);
  png_longjmp(png, 1);
}

void on_warning(png_structp /*png*/, png_const_charp /*message*/) {}

void on_read(png_structp png, png_bytep out, png_size_t size) {
  auto* context = static_cast<Context*>(png_get_io_ptr(png));
  if (context->input.size() - context->at < size) png_error(png, "the file is cut off");
  std::memcpy(out, context->input.data() + context->at, size);
  context->at += size;
}

void on_write(png_structp png, png_bytep bytes, png_size_t size) {
  auto* context = static_cast<Context*>(png_get_io_ptr(png));
  try {
    context->output->write(std::as_bytes(std::span(bytes, size)));
    return;
  } catch (...) {
    context->thrown = std::current_exception();
  }
  png_error(png, "write failed");
}

void on_flush(png_structp /*png*/) {}

/// Owns libpng's state. All calls go through `call`, whose action holds nothing that needs a destructor.
class Png {
 public:
  enum class Use { kRead, kWrite };
  explicit Png(Use use) : use_(use) {
    png_ = use == Use::kRead ? png_create_read_struct(PNG_LIBPNG_VER_STRING, &context, on_error, on_warning)
                             : png_create_write_struct(PNG_LIBPNG_VER_STRING, &context, on_error, on_warning);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
    if (info_ == nullptr) {
      destroy();
      throw std::bad_alloc();
    }
  }
  ~Png() { destroy(); }
  Png(const Png&) = delete;
  Png& operator=(const Png&) = delete;

  template <class Action>
  void call(Action action) {
    if (setjmp(png_jmpbuf(png_)) != 0) fail();
    action(png_, info_);
  }

  Context context;

 private:
  [[noreturn]] void fail() {
    if (context.thrown) std::rethrow_exception(context.thrown);
    throw Error(ErrorCode::kDamaged, "the PNG picture is damaged: " + std::string(context.message.data()))
        .at("", context.at);
  }
  void destroy() {
    if (use_ == Use::kRead) {
      png_destroy_read_struct(&png_, &info_, nullptr);
    } else {
      png_destroy_write_struct(&png_, &info_);
    }
  }

  Use use_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

/// What a PNG gives after libpng expanded palettes, low bit depths and transparent colours.
struct Layout {
  PictureInfo picture;
  std::size_t stored_row_bytes = 0;
  std::size_t row_bytes = 0;
  int channels = 0;
  bool wide = false;  // 16 bits a channel
  int passes = 1;
};

Layout open_png(Png& png) {
  Layout layout;
  png.call([&](png_structp p, png_infop info) {
    constexpr png_uint_32 kNoLimit = 0x7fffffff;  // pixels are counted below, before memory is taken
    png_set_user_limits(p, kNoLimit, kNoLimit);
    png_set_read_fn(p, png_get_error_ptr(p), on_read);
    png_read_info(p, info);
    layout.picture.width = png_get_image_width(p, info);
    layout.picture.height = png_get_image_height(p, info);
    layout.stored_row_bytes = png_get_rowbytes(p, info);
    png_set_expand(p);
    layout.passes = png_set_interlace_handling(p);
    png_read_update_info(p, info);
    layout.row_bytes = png_get_rowbytes(p, info);
    layout.channels = png_get_channels(p, info);
    layout.wide = png_get_bit_depth(p, info) == 16;
    layout.picture.has_alpha = (png_get_color_type(p, info) & PNG_COLOR_MASK_ALPHA) != 0;
  });
  return layout;
}

void to_pixels(const Layout& layout, const png_byte* row, std::vector<Pixel>& out) {
  std::array<std::uint16_t, 4> c{};
  for (Pixel& pixel : out) {
    for (int i = 0; i < layout.channels; ++i) {
      const unsigned value = layout.wide ? row[0] * 256u + row[1] : row[0] * 257u;
      c[static_cast<std::size_t>(i)] = static_cast<std::uint16_t>(value);
      row += layout.wide ? 2 : 1;
    }
    const bool colour = layout.channels >= 3;
    pixel = {c[0], colour ? c[1] : c[0], colour ? c[2] : c[0],
             layout.picture.has_alpha ? c[colour ? 3 : 1] : std::uint16_t{65535}};
  }
}

}  // namespace

void read_png(std::string_view bytes, const PictureSink& sink) {
  Png png(Png::Use::kRead);
  png.context.input = bytes;
  const Layout layout = open_png(png);
  check_pixels(layout.picture.width, layout.picture.height);
  const auto height = static_cast<std::uint64_t>(layout.picture.height);
  constexpr std::uint64_t kMaxDeflateRatio = 1032;  // a smaller file cannot hold the picture
  if (layout.stored_row_bytes > bytes.size() * kMaxDeflateRatio / height + kMaxDeflateRatio) {
    throw Error(ErrorCode::kDamaged, "the PNG picture is damaged: the file is cut off");
  }
  PictureInfo info = layout.picture;
  info.decoding_bytes = static_cast<std::uint64_t>(info.width) * sizeof(Pixel) +
                        layout.row_bytes * (layout.passes == 1 ? 3 : height + 3);
  if (layout.passes > 1) check_pixels(static_cast<std::int64_t>(layout.row_bytes), layout.picture.height);
  sink.begin(info, bytes.size());
  std::vector<Pixel> pixels(static_cast<std::size_t>(layout.picture.width));
  if (layout.passes == 1) {
    std::vector<png_byte> row(layout.row_bytes);
    for (std::uint64_t y = 0; y < height; ++y) {
      png.call([&](png_structp p, png_infop) { png_read_row(p, row.data(), nullptr); });
      to_pixels(layout, row.data(), pixels);
      sink.row(pixels);
    }
  } else {
    std::vector<png_byte> whole(layout.row_bytes * height);
    for (int pass = 0; pass < layout.passes; ++pass) {
      for (std::uint64_t y = 0; y < height; ++y) {
        png.call(
            [&](png_structp p, png_infop) { png_read_row(p, whole.data() + y * layout.row_bytes, nullptr); });
      }
    }
    for (std::uint64_t y = 0; y < height; ++y) {
      to_pixels(layout, whole.data() + y * layout.row_bytes, pixels);
      sink.row(pixels);
    }
  }
  png.call([](png_structp p, png_infop end) { png_read_end(p, end); });
}

void write_png(OutputFile& file, std::int64_t width, std::int64_t height, bool alpha,
               const std::function<void(std::int64_t y, std::span<std::uint8_t> row)>& row) {
  Png png(Png::Use::kWrite);
  png.context.output = &file;
  png.call([&](png_structp p, png_infop info) {
    constexpr png_uint_32 kNoLimit = 0x7fffffff;
    png_set_user_limits(p, kNoLimit, kNoLimit);
    png_set_write_fn(p, png_get_error_ptr(p), on_write, on_flush);
    png_set_IHDR(p, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), 8,
                 alpha ? PNG_COLOR_TYPE_GRAY_ALPHA : PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_filter(p, PNG_FILTER_TYPE_BASE, PNG_FILTER_NONE);
    png_write_info(p, info);
  });
  std::vector<std::uint8_t> line(static_cast<std::size_t>(width) * (alpha ? 2 : 1));
  for (std::int64_t y = 0; y < height; ++y) {
    row(y, line);
    png.call([&](png_structp p, png_infop) { png_write_row(p, line.data()); });
  }
  png.call([](png_structp p, png_infop info) { png_write_end(p, info); });
}

}  // namespace apgm::converters

#include "tools/common/picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <set>

#include "apgm/core/error.hpp"
#include "tools/common/gd_library.hpp"

namespace apgm::tools {
namespace {

constexpr int kMargin = 12;
constexpr int kLeastWidth = 360;
constexpr int kLine = 16;  // from one line of text to the next
constexpr int kEmptyHeight = 120;
constexpr int kSwatch = 14;
constexpr int kScaleWidth = 288;
constexpr int kGridAlpha = 78;  // of 127, which is invisible
constexpr Colour kPaper{255, 255, 255};
constexpr Colour kInk{30, 30, 34};
constexpr Colour kFaint{150, 150, 156};
constexpr Colour kGridInk{0, 96, 170};

struct DestroyImage {
  void operator()(gdImage* image) const { gd().destroy(image); }
};
using Image = std::unique_ptr<gdImage, DestroyImage>;

Image make_image(int width, int height) {
  // libgd reports an overflow on standard error; it is asked for nothing that could.
  const bool fits = width > 0 && height > 0 && std::int64_t{width} * height <= (std::int64_t{1} << 28);
  Image image(fits ? gd().create(width, height) : nullptr);
  if (!image)
    throw Error(ErrorCode::kLimit, fmt::format("cannot make a picture of {} x {} pixels", width, height));
  return image;
}

int ink(Colour c) { return gdTrueColor(c.red, c.green, c.blue); }

void copy_raster(const Raster& raster, gdImage& image, int left, int top) {
  const std::uint8_t* p = raster.rgba.data();
  for (int y = 0; y < raster.height; ++y) {
    int* line = image.tpixels[top + y] + left;
    for (int x = 0; x < raster.width; ++x, p += 4) line[x] = gdTrueColor(p[0], p[1], p[2]);
  }
}

Raster raster_of(const gdImage& image) {
  Raster out{image.sx, image.sy, {}};
  out.rgba.resize(static_cast<std::size_t>(image.sx) * image.sy * 4);
  std::uint8_t* p = out.rgba.data();
  for (int y = 0; y < image.sy; ++y) {
    for (int x = 0; x < image.sx; ++x, p += 4) {
      const int c = image.tpixels[y][x];
      p[0] = static_cast<std::uint8_t>(gdTrueColorGetRed(c));
      p[1] = static_cast<std::uint8_t>(gdTrueColorGetGreen(c));
      p[2] = static_cast<std::uint8_t>(gdTrueColorGetBlue(c));
      p[3] = 255;
    }
  }
  return out;
}

// The built-in fonts know no UTF-8: one '?' for each code point beyond ASCII and each control character.
std::string printable(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x80 && byte < 0xC0) continue;
    out += byte < 0x20 || byte >= 0x7F ? '?' : c;
  }
  return out;
}

int width_of(const std::string& text, const gdFont& font) { return static_cast<int>(text.size()) * font.w; }

void write_text(gdImage& image, const gdFont& font, int x, int y, const std::string& text, Colour colour) {
  for (const char c : text) {
    gd().write_char(&image, const_cast<gdFont*>(&font), x, y, static_cast<unsigned char>(c), ink(colour));
    x += font.w;
  }
}

// Breaks text into lines of at most `columns` characters, at spaces where there are any.
std::vector<std::string> wrap(std::string text, std::size_t columns) {
  std::vector<std::string> lines;
  while (text.size() > columns) {
    std::size_t cut = text.rfind(' ', columns);
    const bool at_space = cut != std::string::npos && cut > 0;
    if (!at_space) cut = columns;
    lines.push_back(text.substr(0, cut));
    text.erase(0, cut + (at_space ? 1 : 0));
  }
  if (!text.empty()) lines.push_back(std::move(text));
  return lines;
}

std::string corner_text(Point p, double pixel_m) {
  // As many digits as tell two pixels apart, between centimetres and micrometres.
  int digits = 2;
  for (double unit = 0.01; digits < 6 && unit > pixel_m; unit /= 10) ++digits;
  const auto tidy = [&](double v) {  // no "-0.00"
    const double least = 0.5 * std::pow(10.0, -digits);
    return std::abs(v) < least ? 0.0 : v;
  };
  return fmt::format("{:.{}f}, {:.{}f} m", tidy(p.x_m), digits, tidy(p.y_m), digits);
}

// Places and draws the parts of a picture from top to bottom.
class Composer {
 public:
  Composer(const Rendering& rendering, const PictureText& text)
      : r_(rendering), title_font_(*gd().bold_font()), font_(*gd().small_font()), up_(printable(text.up)) {
    map_width_ = r_.raster.empty() ? kLeastWidth - 2 * kMargin - 2 : r_.raster.width;
    map_height_ = r_.raster.empty() ? kEmptyHeight : r_.raster.height;
    width_ = std::max(kLeastWidth, map_width_ + 2 + 2 * kMargin);
    for (const auto& e : r_.legend.entries) {
      width_ = std::max(width_, entry_width(e) + 2 * kMargin);
    }
    const auto columns = [&](const gdFont& font) {
      return static_cast<std::size_t>((width_ - 2 * kMargin) / font.w);
    };
    title_ = wrap(printable(text.title), columns(title_font_));
    facts_ = wrap(printable(fmt::format("{}", fmt::join(text.facts, ", "))), columns(font_));
    no_data_ = printable(text.no_data);
    if (!r_.raster.empty()) bar_ = scale_bar(r_.pixel_m, std::clamp(map_width_ / 3, 60, 240));
    flow_legend();
  }

  Raster draw() {
    const bool empty = r_.raster.empty();
    int y = kMargin + kLine * static_cast<int>(title_.size() + facts_.size()) + 4;
    const int corner_y = y;
    if (!empty) y += kLine;
    const int map_y = y + 1;
    y = map_y + map_height_ + 4;
    const int below_y = y;
    if (!empty) y += kLine + 4 + 26;
    const int legend_y = y;
    y += legend_rows_ * (kSwatch + 6) + (has_scale() ? 14 + kLine + 4 : 0);

    image_ = make_image(width_, y + kMargin - 4);
    gd().fill(image_.get(), 0, 0, width_ - 1, image_->sy - 1, ink(kPaper));
    draw_head();
    draw_map(map_y);
    if (!empty) {
      draw_corners(corner_y, below_y);
      draw_bar(below_y + kLine + 4);
      draw_legend(legend_y);
    }
    return raster_of(*image_);
  }

 private:
  struct Place {
    int x, row;
  };

  bool has_scale() const { return !r_.legend.scale.empty() && !r_.raster.empty(); }
  int entry_width(const LegendEntry& e) const { return kSwatch + 5 + width_of(printable(e.label), font_); }
  int map_left() const { return (width_ - map_width_) / 2; }

  void flow_legend() {
    if (r_.raster.empty()) return;
    int x = kMargin, row = 0;
    for (const auto& e : r_.legend.entries) {
      const int w = entry_width(e);
      if (x > kMargin && x + w > width_ - kMargin) {
        x = kMargin;
        ++row;
      }
      places_.push_back({x, row});
      x += w + 16;
    }
    legend_rows_ = places_.empty() ? 0 : row + 1;
  }

  void text(int x, int y, const std::string& words, Colour colour = kInk) {
    write_text(*image_, font_, x, y, words, colour);
  }

  void draw_head() {
    int y = kMargin;
    for (const auto& line : title_) {
      write_text(*image_, title_font_, kMargin, y, line, kInk);
      y += kLine;
    }
    for (const auto& line : facts_) {
      text(kMargin, y, line);
      y += kLine;
    }
  }

  void draw_map(int top) {
    const int left = map_left();
    if (r_.raster.empty()) {
      text(std::max(kMargin, (width_ - width_of(no_data_, font_)) / 2), top + (map_height_ - font_.h) / 2,
           no_data_);
    } else {
      copy_raster(r_.raster, *image_, left, top);
      draw_grid(left, top);
    }
    gd().frame(image_.get(), left - 1, top - 1, left + map_width_, top + map_height_, ink(kFaint));
  }

  // Every side of a patch once, on the first pixel right of or below the border.
  void draw_grid(int left, int top) {
    if (r_.patch_px <= 0) return;
    std::set<std::pair<int, int>> columns, rows;
    for (const auto& p : r_.patches) {
      columns.insert({p.left, p.top});
      columns.insert({p.left + r_.patch_px, p.top});
      rows.insert({p.left, p.top});
      rows.insert({p.left, p.top + r_.patch_px});
    }
    gd().set_clip(image_.get(), left, top, left + map_width_ - 1, top + map_height_ - 1);
    const int line = gdTrueColorAlpha(kGridInk.red, kGridInk.green, kGridInk.blue, kGridAlpha);
    for (const auto& [x, y] : columns) {
      gd().fill(image_.get(), left + x, top + y, left + x, top + y + r_.patch_px - 1, line);
    }
    for (const auto& [x, y] : rows) {
      gd().fill(image_.get(), left + x + 1, top + y, left + x + r_.patch_px - 1, top + y, line);
    }
    gd().set_clip(image_.get(), 0, 0, image_->sx - 1, image_->sy - 1);
  }

  void draw_corners(int above_y, int below_y) {
    const std::string high = corner_text(r_.area.max, r_.pixel_m);
    const std::string low = corner_text(r_.area.min, r_.pixel_m);
    text(std::max(kMargin, map_left() + map_width_ - width_of(high, font_)), above_y, high, kFaint);
    text(std::min(map_left(), width_ - kMargin - width_of(low, font_)), below_y, low, kFaint);
  }

  // From its first to its last pixel the bar is length_px wide.
  void draw_bar(int y) {
    const int x1 = kMargin + bar_->length_px - 1;
    gd().fill(image_.get(), kMargin, y + 6, x1, y + 8, ink(kInk));
    for (const int x : {kMargin, x1}) gd().fill(image_.get(), x, y + 2, x, y + 12, ink(kInk));
    text(x1 + 8, y + 1, bar_->label);

    const int tip = width_ - kMargin - 8;
    gd().fill(image_.get(), tip, y, tip, y + 14, ink(kInk));
    for (int i = 1; i <= 4; ++i) {
      gd().set_pixel(image_.get(), tip - i, y + i, ink(kInk));
      gd().set_pixel(image_.get(), tip + i, y + i, ink(kInk));
    }
    text(tip - 8 - width_of(up_, font_), y + 1, up_);
  }

  void draw_legend(int top) {
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const auto& e = r_.legend.entries[i];
      const int x = places_[i].x, y = top + places_[i].row * (kSwatch + 6);
      gd().fill(image_.get(), x, y, x + kSwatch - 1, y + kSwatch - 1, ink(e.colour));
      gd().frame(image_.get(), x, y, x + kSwatch - 1, y + kSwatch - 1, ink(kFaint));
      text(x + kSwatch + 5, y, printable(e.label));
    }
    if (has_scale()) draw_scale(top + legend_rows_ * (kSwatch + 6));
  }

  void draw_scale(int y) {
    const auto& samples = r_.legend.scale;
    const auto last = static_cast<int>(samples.size()) - 1;
    for (int i = 0; i < kScaleWidth; ++i) {
      const int place = i * last, n = kScaleWidth - 1;
      const Colour a = samples[static_cast<std::size_t>(place / n)].colour;
      const Colour b = samples[static_cast<std::size_t>(std::min(last, place / n + 1))].colour;
      const auto blend = [&](int from, int to) { return from + (to - from) * (place % n) / n; };
      const int c = gdTrueColor(blend(a.red, b.red), blend(a.green, b.green), blend(a.blue, b.blue));
      gd().fill(image_.get(), kMargin + i, y, kMargin + i, y + 12, c);
    }
    gd().frame(image_.get(), kMargin - 1, y - 1, kMargin + kScaleWidth, y + 13, ink(kFaint));
    const auto label = [&](int sample, int quarter) {
      const std::string words = printable(samples[static_cast<std::size_t>(sample)].label);
      const int free = kScaleWidth - width_of(words, font_);
      text(kMargin + free * quarter / 4, y + 16, words);
    };
    label(0, 0);
    if (last > 0 && last % 2 == 0) label(last / 2, 2);
    if (last > 0) label(last, 4);
  }

  const Rendering& r_;
  const gdFont& title_font_;
  const gdFont& font_;
  std::string up_, no_data_;
  std::vector<std::string> title_, facts_;
  std::vector<Place> places_;
  std::optional<ScaleBar> bar_;
  int map_width_ = 0, map_height_ = 0, width_ = 0, legend_rows_ = 0;
  Image image_;
};

struct FreePng {
  void operator()(void* bytes) const { gd().free(bytes); }
};

}  // namespace

ScaleBar scale_bar(double pixel_m, int most_px) {
  const double most_m = pixel_m * most_px * (1 + 1e-9);
  double best_m = 0;
  double ten = 1e-12;
  for (int exponent = -12; exponent <= 13; ++exponent) {
    // Powers of ten up to 1e22 are exact, so their quotients are the nearest doubles.
    ten = 1;
    for (int i = 0; i < std::abs(exponent); ++i) ten *= 10;
    for (const double digit : {1.0, 2.0, 5.0}) {
      const double length_m = exponent < 0 ? digit / ten : digit * ten;
      if (length_m <= most_m) best_m = length_m;
    }
  }
  struct Unit {
    double metres;
    const char* name;
  };
  constexpr std::array<Unit, 5> kUnits{{{1e3, "km"}, {1, "m"}, {1e-2, "cm"}, {1e-3, "mm"}, {1e-6, "um"}}};
  const auto fits = [&](const Unit& u) { return best_m >= u.metres * (1 - 1e-9); };
  const auto unit = std::find_if(kUnits.begin(), kUnits.end(), fits);
  const Unit& chosen = unit == kUnits.end() ? kUnits.back() : *unit;
  return {best_m, std::max(1, static_cast<int>(std::lround(best_m / pixel_m))),
          fmt::format("{:.6g} {}", best_m / chosen.metres, chosen.name)};
}

Raster compose(const Rendering& rendering, const PictureText& text) {
  return Composer(rendering, text).draw();
}

void write_png(const Raster& raster, OutputFile& out) {
  const Image image = make_image(raster.width, raster.height);
  copy_raster(raster, *image, 0, 0);
  int size = 0;
  const std::unique_ptr<void, FreePng> bytes(gd().encode_png(image.get(), &size, 6));
  if (!bytes || size <= 0) throw Error(ErrorCode::kLimit, "cannot encode the picture as PNG");
  out.write(std::span(static_cast<const std::byte*>(bytes.get()), static_cast<std::size_t>(size)));
}

}  // namespace apgm::tools

#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <string>

#include "apgm/core/error.hpp"
#include "apgm/core/layer.hpp"
#include "apgm/ops/render.hpp"

namespace apgm::ops {

/// One pixel of a Raster. While a ramp's range is not known yet, its four bytes hold the value as a float.
struct Pixel {
  std::uint8_t red = 0;
  std::uint8_t green = 0;
  std::uint8_t blue = 0;
  std::uint8_t alpha = 255;
};
static_assert(sizeof(Pixel) == 4);

inline constexpr Colour kOccupied{20, 20, 24};
inline constexpr Colour kFree{250, 250, 246};
inline constexpr Colour kUnknown{132, 148, 168};

inline constexpr Colour kBoth{240, 228, 66};
inline constexpr Colour kNoEvidence{236, 236, 236};

inline constexpr Colour kNoData{214, 214, 214};

// The palette of Okabe and Ito ("Color Universal Design", 2008), ordered so that the first classes lie far
// apart; the second half repeats it darker, for frames of more than eight hypotheses.
inline constexpr std::array<Colour, 15> kCategoryColours{{{86, 180, 233},
                                                          {240, 228, 66},
                                                          {213, 94, 0},
                                                          {0, 158, 115},
                                                          {204, 121, 167},
                                                          {0, 114, 178},
                                                          {230, 159, 0},
                                                          {0, 0, 0},
                                                          {43, 90, 116},
                                                          {120, 114, 33},
                                                          {106, 47, 0},
                                                          {0, 79, 57},
                                                          {102, 60, 83},
                                                          {0, 57, 89},
                                                          {115, 79, 0}}};

// Samples of a perceptually even violet-green-yellow scale at equal distances.
inline constexpr std::array<Colour, 10> kRampColours{{{68, 1, 84},
                                                      {72, 40, 120},
                                                      {62, 74, 137},
                                                      {49, 104, 142},
                                                      {38, 130, 142},
                                                      {31, 158, 137},
                                                      {53, 183, 121},
                                                      {109, 205, 89},
                                                      {180, 222, 44},
                                                      {253, 231, 37}}};

// Not-a-number becomes 0: std::max returns its first argument when the comparison is false.
inline std::uint8_t to_byte(float value) {
  return static_cast<std::uint8_t>(std::min(255.0f, std::max(0.0f, value)) + 0.5f);
}

// A weighted sum of colours. Weights sum to 1 for valid masses.
class Mix {
 public:
  void add(float weight, Colour c) {
    red_ += weight * static_cast<float>(c.red);
    green_ += weight * static_cast<float>(c.green);
    blue_ += weight * static_cast<float>(c.blue);
  }
  Pixel pixel() const { return {to_byte(red_), to_byte(green_), to_byte(blue_), 255}; }

 private:
  float red_ = 0;
  float green_ = 0;
  float blue_ = 0;
};

inline Pixel opaque(Colour c) { return {c.red, c.green, c.blue, 255}; }

inline Pixel belief(float occupied, float free) {
  Mix mix;
  mix.add(occupied, kOccupied);
  mix.add(free, kFree);
  mix.add(std::max(0.0f, 1.0f - occupied - free), kUnknown);
  return mix.pixel();
}

inline Pixel evidence(float occupied, float free) {
  const float both = std::min(occupied, free);
  Mix mix;
  mix.add(occupied - both, kCategoryColours[2]);
  mix.add(free - both, kCategoryColours[5]);
  mix.add(2.0f * both, kBoth);
  mix.add(std::max(0.0f, 1.0f - occupied - free), kNoEvidence);
  return mix.pixel();
}

inline Pixel grey(float occupied, float free) {
  const float p = occupied + 0.5f * (1.0f - occupied - free);
  const std::uint8_t shade = p >= 0.65f ? 0 : p <= 0.25f ? 254 : 205;
  return {shade, shade, shade, 255};
}

inline Colour ramp(float t) {
  const float place = std::min(1.0f, std::max(0.0f, t)) * static_cast<float>(kRampColours.size() - 1);
  const auto i = std::min(static_cast<std::size_t>(place), kRampColours.size() - 2);
  const float f = place - static_cast<float>(i);
  Mix mix;
  mix.add(1.0f - f, kRampColours[i]);
  mix.add(f, kRampColours[i + 1]);
  const Pixel p = mix.pixel();
  return {p.red, p.green, p.blue};
}

inline std::string number(float value) {
  std::array<char, 32> text{};
  const auto end =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, 4);
  return {text.data(), end.ptr};
}

inline Colormap chosen(const LayerType& type, Colormap asked) {
  Colormap result = asked;
  if (asked == Colormap::kDefault) {
    result = type.is_occupancy()  ? Colormap::kBelief
             : type.is_evidence() ? Colormap::kCategories
                                  : Colormap::kRamp;
  }
  const bool fits = result == Colormap::kRamp         ? !type.is_evidence()
                    : result == Colormap::kCategories ? type.is_evidence()
                                                      : type.is_occupancy();
  if (fits) return result;
  const char* hint = type.is_occupancy()  ? "use belief, evidence, grey or categories"
                     : type.is_evidence() ? "use categories"
                                          : "use ramp";
  throw Error(ErrorCode::kInvalidArgument,
              "the colormap '" + std::string(to_string(result)) + "' does not fit layer '" + type.name + "'")
      .hint(hint);
}

/// Turns cells of one type into pixels. Masses out of range, as a hostile file may hold, give some colour.
class Colouring {
 public:
  /// @throws Error{kInvalidArgument} if the colormap or channel does not fit the type
  Colouring(const LayerType& type, Colormap colormap, int channel);

  /// Pixel of a cell without data.
  Pixel nothing() const;
  /// Pixels of the cells [first, first + out.size()) of `layer`.
  void paint(const Layer& layer, std::size_t first, std::span<Pixel> out) const;
  /// Gives a ramp's pixels their colours, now that all values are known. Once, after the last cell.
  /// @param rgba  pixels as paint and nothing left them
  void finish(std::span<std::uint8_t> rgba);
  /// Valid after finish.
  const Legend& legend() const { return legend_; }

 private:
  void paint_masses(const Layer& layer, std::size_t first, std::span<Pixel> out) const;
  void paint_occupancy(const Layer& layer, std::size_t first, std::span<Pixel> out) const;
  void paint_values(const Layer& layer, std::size_t first, std::span<Pixel> out) const;
  void make_legend(const LayerType& type);
  void finish_ramp(std::span<std::uint8_t> rgba);

  Colormap colormap_;
  int channel_;
  float background_;
  std::size_t hypotheses_;
  Legend legend_;
};

inline Colouring::Colouring(const LayerType& type, Colormap colormap, int channel)
    : colormap_(chosen(type, colormap)),
      channel_(channel),
      background_(0),
      hypotheses_(type.hypotheses.size()) {
  if (channel < 0 || channel >= static_cast<int>(type.channels.size())) {
    throw Error(ErrorCode::kInvalidArgument,
                "layer '" + type.name + "' has no channel number " + std::to_string(channel));
  }
  background_ = type.background(channel);
  make_legend(type);
}

inline Pixel Colouring::nothing() const {
  switch (colormap_) {
    case Colormap::kGrey:
      return {205, 205, 205, 255};
    case Colormap::kEvidence:
    case Colormap::kCategories:
      return opaque(kNoEvidence);
    case Colormap::kRamp:
      return std::bit_cast<Pixel>(std::numeric_limits<float>::quiet_NaN());
    case Colormap::kDefault:
    case Colormap::kBelief:
      break;
  }
  return opaque(kUnknown);
}

inline void Colouring::paint(const Layer& layer, std::size_t first, std::span<Pixel> out) const {
  if (colormap_ == Colormap::kRamp) return paint_values(layer, first, out);
  if (colormap_ == Colormap::kCategories) return paint_masses(layer, first, out);
  paint_occupancy(layer, first, out);
}

inline void Colouring::paint_occupancy(const Layer& layer, std::size_t first, std::span<Pixel> out) const {
  const auto occupied = layer.plane(0).subspan(first, out.size());
  const auto free = layer.plane(1).subspan(first, out.size());
  const auto colour = colormap_ == Colormap::kGrey       ? grey
                      : colormap_ == Colormap::kEvidence ? evidence
                                                         : belief;
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = colour(occupied[i], free[i]);
}

inline void Colouring::paint_masses(const Layer& layer, std::size_t first, std::span<Pixel> out) const {
  for (std::size_t i = 0; i < out.size(); ++i) {
    Mix mix;
    float rest = 1.0f;
    for (std::size_t k = 0; k < hypotheses_; ++k) {
      const float mass = layer.plane(static_cast<int>(k))[first + i];
      mix.add(mass, kCategoryColours[k]);
      rest -= mass;
    }
    mix.add(std::max(0.0f, rest), kNoEvidence);
    out[i] = mix.pixel();
  }
}

inline void Colouring::paint_values(const Layer& layer, std::size_t first, std::span<Pixel> out) const {
  const auto values = layer.plane(channel_).subspan(first, out.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const bool no_data = !std::isfinite(values[i]) || values[i] == background_;
    out[i] = no_data ? nothing() : std::bit_cast<Pixel>(values[i]);
  }
}

inline void Colouring::finish(std::span<std::uint8_t> rgba) {
  if (colormap_ == Colormap::kRamp) finish_ramp(rgba);
}

inline void Colouring::finish_ramp(std::span<std::uint8_t> rgba) {
  const auto value_at = [&](std::size_t i) {
    float value = 0;
    std::memcpy(&value, rgba.data() + i, sizeof value);
    return value;
  };
  float least = std::numeric_limits<float>::infinity();
  float greatest = -least;
  for (std::size_t i = 0; i < rgba.size(); i += sizeof(Pixel)) {
    const float value = value_at(i);
    if (std::isnan(value)) continue;
    least = std::min(least, value);
    greatest = std::max(greatest, value);
  }
  // Halved, so that the span of two finite values cannot overflow.
  const float half_span = 0.5f * greatest - 0.5f * least;
  const auto colour_of = [&](float value) {
    return half_span > 0 ? ramp((0.5f * value - 0.5f * least) / half_span) : ramp(0.5f);
  };
  for (std::size_t i = 0; i < rgba.size(); i += sizeof(Pixel)) {
    const float value = value_at(i);
    const Pixel pixel = opaque(std::isnan(value) ? kNoData : colour_of(value));
    std::memcpy(rgba.data() + i, &pixel, sizeof pixel);
  }
  if (least > greatest) return;
  // The ramp is linear between its colours: two samples a piece show it exactly, with one in the middle.
  const int last = half_span > 0 ? 2 * static_cast<int>(kRampColours.size() - 1) : 0;
  for (int s = 0; s <= last; ++s) {
    const float t = last == 0 ? 0.0f : static_cast<float>(s) / static_cast<float>(last);
    const float value = s == last ? greatest : least + 2.0f * (t * half_span);
    legend_.scale.push_back({number(value), colour_of(value)});
  }
}

inline void Colouring::make_legend(const LayerType& type) {
  auto& entries = legend_.entries;
  switch (colormap_) {
    case Colormap::kEvidence:
      entries = {{"occupied", kCategoryColours[2]},
                 {"free", kCategoryColours[5]},
                 {"both in one cell", kBoth},
                 {"unknown", kNoEvidence}};
      break;
    case Colormap::kGrey:
      entries = {{"occupied", {0, 0, 0}}, {"free", {254, 254, 254}}, {"unknown", {205, 205, 205}}};
      break;
    case Colormap::kCategories:
      for (std::size_t k = 0; k < hypotheses_; ++k) {
        entries.push_back({type.hypotheses[k], kCategoryColours[k]});
      }
      entries.push_back({"unknown", kNoEvidence});
      break;
    case Colormap::kRamp:
      entries = {{"no data", kNoData}};
      break;
    case Colormap::kDefault:
    case Colormap::kBelief:
      entries = {{"occupied", kOccupied}, {"free", kFree}, {"unknown", kUnknown}};
      break;
  }
}

}  // namespace apgm::ops

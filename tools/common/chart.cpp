#include "tools/common/chart.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

namespace apgm::tools {
namespace {

constexpr std::array kColours{"#c0392b", "#2471a3", "#1e8449", "#8e44ad", "#d68910",
                              "#117a65", "#7b241c", "#34495e", "#b03a7b", "#707b7c"};
constexpr std::array kBackgrounds{"#f6e3b4", "#cfe6cf", "#d6e4f0", "#ead7ee"};
constexpr const char* colour(std::size_t i) { return kColours[i % kColours.size()]; }

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&') {
      out += "&amp;";
    } else if (c == '<') {
      out += "&lt;";
    } else if (c == '>') {
      out += "&gt;";
    } else if (static_cast<unsigned char>(c) >= ' ') {
      out += c;
    }
  }
  return out;
}

std::string text_at(double x, double y, const std::string& words, const char* anchor = "middle",
                    const char* more = "") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>\n", x, y, anchor, more,
                     escaped(words));
}

std::string rectangle(double x, double y, double width, double height, const char* fill) {
  return fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>\n", x,
                     y, width, height, fill);
}

std::string line_at(double x0, double y0, double x1, double y1, const char* stroke, double width) {
  return fmt::format(
      "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" stroke-width=\"{}\"/>\n",
      x0, y0, x1, y1, stroke, width);
}

std::string document(double width, double height, const std::string& body) {
  return fmt::format(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0f} {:.0f}\" "
             "font-family=\"sans-serif\" "
             "font-size=\"12\">\n",
             width, height) +
         rectangle(0, 0, width, height, "white") + body + "</svg>\n";
}

/// 1, 2 or 5 times a power of ten that divides `span` into four to ten.
double tick_of(double span) {
  const double power = std::pow(10.0, std::floor(std::log10(span)) - 1);
  for (const double tick : {power, 2 * power, 5 * power, 10 * power}) {
    if (span / tick <= 10) return tick;
  }
  return 20 * power;
}

class LinePainter {
 public:
  explicit LinePainter(const LineChart& chart) : chart_(chart) {
    double low = HUGE_VAL, high = 0;
    begin_ = HUGE_VAL;
    end_ = -HUGE_VAL;
    for (const auto& line : chart.lines) {
      for (const auto& [time, value] : line.points) {
        begin_ = std::min(begin_, time);
        end_ = std::max(end_, time);
        if (value > 0) {
          low = std::min(low, value);
          high = std::max(high, value);
        }
      }
    }
    if (!(high > 0)) low = high = 1;
    if (!(begin_ < end_)) {
      begin_ = std::isfinite(begin_) ? begin_ : 0;
      end_ = begin_ + 1;
    }
    low_ = std::log10(low) - 0.1;
    high_ = std::log10(high) + 0.2;
    height_ = std::max(kHeight, kTop + 18.0 * static_cast<double>(chart.lines.size()) + 20);
  }

  std::string body() const {
    std::string out = background() + scales();
    for (std::size_t i = 0; i < chart_.lines.size(); ++i) out += curve(i);
    return out + text_at(kLeft, 18, chart_.title, "start", " font-weight=\"bold\"");
  }
  double height() const { return height_; }
  static constexpr double kWidth = 980;

 private:
  static constexpr double kHeight = 360, kLeft = 70, kRight = 230, kTop = 32, kBottom = 42;
  static constexpr double kLetter = 6.8;  // width of a letter, at most

  double x(double time) const {
    return kLeft + (kWidth - kLeft - kRight) * (time - begin_) / (end_ - begin_);
  }
  double y(double value) const {
    return kTop + (height_ - kTop - kBottom) * (high_ - std::log10(value)) / (high_ - low_);
  }

  std::string background() const {
    std::string out;
    std::vector<std::string> names;
    for (const auto& stretch : chart_.stretches) {
      const auto at = std::ranges::find(names, stretch.name);
      const auto i = static_cast<std::size_t>(at - names.begin());
      if (at == names.end()) names.push_back(stretch.name);
      out += rectangle(x(stretch.from), kTop, x(stretch.to) - x(stretch.from), height_ - kTop - kBottom,
                       kBackgrounds[i % kBackgrounds.size()]);
      const double width = x(stretch.to) - x(stretch.from);
      if (width < kLetter * static_cast<double>(stretch.name.size())) continue;
      out += text_at(x((stretch.from + stretch.to) / 2), kTop + 14, stretch.name);
    }
    return out;
  }

  std::string scales() const {
    std::string out;
    for (int power = static_cast<int>(std::floor(low_)); power <= static_cast<int>(high_); ++power) {
      for (const int digit : {1, 2, 5}) {
        const double value = digit * std::pow(10.0, power);
        if (std::log10(value) < low_ || std::log10(value) > high_) continue;
        out += line_at(kLeft, y(value), kWidth - kRight, y(value), "#bbbbbb", 0.6);
        out += text_at(kLeft - 6, y(value) + 4, fmt::format("{:g}", value), "end");
      }
    }
    const double tick = tick_of(end_ - begin_);
    for (double time = std::ceil(begin_ / tick) * tick; time <= end_ + tick * 1e-6; time += tick) {
      out += line_at(x(time), height_ - kBottom, x(time), height_ - kBottom + 4, "#555555", 1);
      out += text_at(x(time), height_ - kBottom + 17, fmt::format("{:g}", time));
    }
    out += text_at((kLeft + kWidth - kRight) / 2, height_ - 8, chart_.x_label);
    const double middle = (kTop + height_ - kBottom) / 2;
    return out + text_at(16, middle, chart_.y_label, "middle",
                         fmt::format(" transform=\"rotate(-90 16 {:.1f})\"", middle).c_str());
  }

  std::string curve(std::size_t i) const {
    const auto& line = chart_.lines[i];
    std::string points;
    for (const auto& [time, value] : line.points) {
      if (value > 0) points += fmt::format("{:.1f},{:.1f} ", x(time), y(value));
    }
    const double at = kTop + 10 + 18.0 * static_cast<double>(i);
    return fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"/>\n", points,
                       colour(i)) +
           line_at(kWidth - kRight + 12, at, kWidth - kRight + 32, at, colour(i), 2.5) +
           text_at(kWidth - kRight + 38, at + 4, line.name, "start");
  }

  const LineChart& chart_;
  double begin_, end_, low_, high_, height_;
};

}  // namespace

std::string to_svg(const std::vector<LineChart>& charts) {
  std::string out;
  double top = 0;
  for (const LineChart& chart : charts) {
    const LinePainter painter(chart);
    out += fmt::format("<g transform=\"translate(0 {:.1f})\">\n{}</g>\n", top, painter.body());
    top += painter.height();
  }
  return document(LinePainter::kWidth, top, out);
}

std::string to_svg(const BarChart& chart) {
  constexpr double kWidth = 900, kLeft = 170, kRight = 170, kTop = 54, kBar = 13, kGap = 10;
  double most = 0;
  for (const auto& group : chart.groups) {
    for (const auto& bar : group.bars) most = std::max(most, bar.value);
  }
  std::string out = text_at(12, 20, chart.title, "start", " font-weight=\"bold\"");
  for (std::size_t k = 0; k < chart.kinds.size(); ++k) {
    const double x = kLeft + 150.0 * static_cast<double>(k);
    out += rectangle(x, 32, 12, 10, colour(k)) + text_at(x + 17, 41, chart.kinds[k], "start");
  }
  double y = kTop;
  for (const auto& group : chart.groups) {
    const double height = kBar * static_cast<double>(group.bars.size());
    out += text_at(kLeft - 8, y + height / 2 + 4, group.name, "end");
    for (std::size_t k = 0; k < group.bars.size(); ++k) {
      const auto& bar = group.bars[k];
      if (bar.value < 0) continue;
      const double width = most > 0 ? (kWidth - kLeft - kRight) * bar.value / most : 0;
      const double at = y + kBar * static_cast<double>(k);
      out += rectangle(kLeft, at, std::max(width, 0.5), kBar - 2, colour(k));
      out += text_at(kLeft + width + 5, at + kBar - 4, bar.label, "start", " font-size=\"10.5\"");
    }
    y += height + kGap;
  }
  out += line_at(kLeft, kTop - 4, kLeft, y - kGap + 4, "#555555", 1);
  return document(kWidth, y + 4, out);
}

}  // namespace apgm::tools

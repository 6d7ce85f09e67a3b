#pragma once

#include <string>
#include <utility>
#include <vector>

namespace apgm::tools {

/// Curves over time on a logarithmic scale, with the stretches of time that have a name in the background.
struct LineChart {
  struct Line {
    std::string name;
    std::vector<std::pair<double, double>> points;  ///< time, value > 0; others are left out
  };
  struct Stretch {
    std::string name;
    double from = 0, to = 0;
  };
  std::string title, x_label, y_label;
  std::vector<Stretch> stretches;
  std::vector<Line> lines;
};

/// Groups of horizontal bars from 0.
struct BarChart {
  struct Bar {
    double value = 0;
    std::string label;  ///< at its end
  };
  struct Group {
    std::string name;
    std::vector<Bar> bars;  ///< one for each of `kinds`; a negative value: none
  };
  std::string title;
  std::vector<std::string> kinds;
  std::vector<Group> groups;
};

/// SVG documents; the same text for the same numbers.
/// Charts of lines stand one above the other.
std::string to_svg(const std::vector<LineChart>& charts);
std::string to_svg(const BarChart& chart);

}  // namespace apgm::tools

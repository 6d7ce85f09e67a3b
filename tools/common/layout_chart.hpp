#pragma once

#include <string>
#include <vector>

#include "tools/common/chart.hpp"
#include "tools/common/layout_table.hpp"

namespace apgm::tools {

/// Collects a drive and draws it.
class LayoutChart {
 public:
  void add(const LayoutsAt& at);
  /// SVG: for one moment bars of values, memory and disk; for several the values of each layout over time,
  /// and below them the times of shifts where these were measured. Layouts of equal curves share one.
  std::string svg(const std::string& title) const;

 private:
  struct Moment {
    double time_s = 0;
    std::string profile;
    std::vector<double> values_mb, shift_ms;  ///< by layout; 0: none
  };
  std::string bars(const std::string& title) const;
  std::string lines(const std::string& title) const;
  /// Curves of what `of` holds by layout; without layouts that are 0 throughout.
  LineChart curves(const std::string& title, const std::string& unit, std::vector<double> Moment::*of) const;

  std::vector<LayoutRow> last_;
  std::vector<Moment> moments_;
};

}  // namespace apgm::tools

#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "apgm/observe/model.hpp"

namespace apgm::observe {

/// One number of the models: its place in the YAML, its range, and where it is kept.
struct Parameter {
  std::string_view section;
  std::string_view key;
  double* value;
  double min, max;
  bool min_open = false, max_open = false;  ///< the bound itself is not allowed

  /// False for NaN.
  bool holds(double v) const { return (min_open ? v > min : v >= min) && (max_open ? v < max : v <= max); }
  /// "lies in [0, 1)".
  std::string range() const;
};

/// All of them, section by section, in the order of docs/observe.md.
std::vector<Parameter> parameters(Models& models);

/// "is 1.5, which is out of range".
std::string out_of_range(double value);

/// A number as people write it: the shortest that reads back as the same double.
std::string number_text(double value);

}  // namespace apgm::observe

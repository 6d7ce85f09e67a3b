#pragma once

#include <map>
#include <string>
#include <vector>

#include "tools/common/comparison.hpp"
#include "tools/common/json.hpp"

namespace apgm::tools {

/// The rows of one moment of a drive, or of a map.
struct LayoutsAt {
  double time_s = 0;
  std::string profile;  ///< empty: none
  Point vehicle;
  std::vector<LayoutRow> rows;  ///< the map itself first
};

/// Heading and lines of a CSV table: a row for each moment and layout. Fields that were not measured are
/// empty.
std::string layouts_csv_heading();
std::string layouts_csv(const LayoutsAt& at);

/// Means over moments: what a table for people and the JSON document show.
class LayoutMeans {
 public:
  void add(const LayoutsAt& at);
  std::uint64_t moments() const { return moments_; }
  double from_s() const { return from_s_; }
  double to_s() const { return to_s_; }
  /// Array of objects, one a layout, with ratios to the first.
  Json json() const;
  /// Sizes, ratios, and where measured bytes on disk, changes of belief and costs.
  std::string text() const;

 private:
  struct Sums {
    std::string layout;
    int values_per_cell = 0;
    double cells = 0, values = 0, known = 0, allocated = 0, disk = 0;
    std::uint64_t in_memory = 0, disks = 0, changes = 0, costs = 0;  ///< moments with these figures
    std::uint64_t shifts = 0;
    std::string note;  ///< the last
    std::uint64_t most_values = 0;
    BeliefChange change;
    LayoutCost cost;
  };
  static double mean_disk(const Sums& sums);
  Json size_json(const Sums& sums) const;
  std::string sizes_text() const;
  std::string beliefs_text() const;
  std::string costs_text() const;

  std::uint64_t moments_ = 0;
  double from_s_ = 0, to_s_ = 0;
  std::vector<Sums> layouts_;
};

}  // namespace apgm::tools

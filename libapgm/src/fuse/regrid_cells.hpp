#pragma once

#include <memory>
#include <vector>

#include "apgm/core/layer_type.hpp"

namespace apgm::fuse {

/// How a value of source cells becomes one of the target cell they overlap.
enum class Pool : std::uint8_t {
  kExtensive,  ///< each cell gives the part of its value that lies in the target: sums are conserved
  kIntensive,  ///< each cell gives its value times the part of the target it covers
  kLeast,
  kGreatest,
};

/// The values in which the cells of a type add over area (docs/theory.md, "Arbitrary ratio or offset").
class CellModel {
 public:
  static std::unique_ptr<CellModel> make(const LayerType& type);
  virtual ~CellModel() = default;

  /// One for each value, in the order of the values.
  const std::vector<Pool>& pools() const { return pools_; }
  /// Values of a cell with data; false for one without.
  virtual bool measure(const float* channels, double* values) const = 0;
  /// The cell of the pooled values.
  virtual void restore(const double* values, float* channels) const = 0;

 protected:
  std::vector<Pool> pools_;
};

}  // namespace apgm::fuse

#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "apgm/core/source.hpp"

namespace apgm::bench {

/// How the masses of a map are spread over the float32 values.
enum class Model : std::uint8_t {
  kContinuous,  ///< noise in every mantissa bit, as Dempster's rule leaves it
  kStepped,     ///< few distinct values, as counters and thresholds leave them
};

struct CityOptions {
  std::uint64_t known_cells = 1'000'000;  ///< reached exactly
  std::uint64_t seed = 1;                 ///< of masses and gaps; streets and houses stay where they are
  Model model = Model::kContinuous;
  double overlap = 1;  ///< share of the width in common with a map of overlap 1, in [0, 1]
};

/// A town as fused occupancy in 0.1 m cells and 12.8 m patches: free streets with parked cars, walls along
/// the blocks, gaps in the walls with a yard behind, unknown insides. Made patch by patch when it is loaded:
/// memory does not grow with the town, but for 16 bytes a patch.
///
/// Guarantee: same cells on every machine.
class City final : public PatchSource {
 public:
  static constexpr int kStep = 7;

  explicit City(const CityOptions& options);

  const MapHeader& header() const override { return header_; }
  Summary summary() const override;
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override;
  void load(const LayerInfo& info, Layer& out) const override;

 private:
  enum class Kind : std::uint8_t { kUnknown, kFree, kOccupied };
  Kind kind_at(std::int64_t i, std::int64_t j) const;
  void write_cell(Layer& out, std::size_t at, std::int64_t i, std::int64_t j, Kind kind) const;
  std::uint64_t known_in(PatchIndex patch) const;
  /// Takes patches of a k x k square in key order until `known_cells` are reached; false if it is too small.
  bool plan(int patches_a_side);

  CityOptions options_;
  MapHeader header_;
  std::vector<PatchIndex> patches_;  // in key order
  std::uint64_t known_in_last_ = 0;  // the last patch is cut to this many known cells
};

}  // namespace apgm::bench

#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "apgm/observe/model.hpp"

namespace apgm::observe {

/// The layers of one measurement while it is taken in, and their memory from one measurement to the next.
class ObservedLayers {
 public:
  static constexpr int kUnwanted = -1;

  /// @param max_bytes  of values that a single measurement may fill; memory of earlier ones counts
  ObservedLayers(LayerType type, std::uint64_t max_bytes) : type_(std::move(type)), max_bytes_(max_bytes) {}

  const LayerType& type() const { return type_; }
  /// Begins a measurement: no layers. Those handed out before are used again.
  void begin_measurement();
  /// Position of the layer of `patch`, made without data when absent; kUnwanted if `step_of` gives no step,
  /// and for all that comes beyond max_bytes. `step_of` is asked once a patch and measurement.
  /// @throws Error{kLimit} if the step is not in 0..11, or as check_size if there is no end of it
  int find(PatchIndex patch, const StepOf& step_of);
  /// To be called once all patches were looked for.
  /// @throws over_budget() if they do not fit into max_bytes: with what they need
  void check_size() const;
  ObservedLayer& operator[](int at) { return layers_[static_cast<std::size_t>(at)]; }
  auto begin() { return layers_.begin(); }
  auto end() { return layers_.end(); }
  /// Ends a measurement: layers without data go, the others are stamped and sorted by curve_key.
  std::span<const ObservedLayer> finish(std::int64_t stamp_ns);
  /// Takes the layers back, and keeps the memory of at most so many bytes.
  void trim(std::uint64_t most);

 private:
  int make(PatchIndex patch, int step);
  void free_unused();
  void clear_rows(ObservedLayer& layer) const;
  void recycle(ObservedLayer&& layer);
  bool has_data(const ObservedLayer& layer) const;

  LayerType type_;
  std::uint64_t max_bytes_;
  std::vector<ObservedLayer> layers_;
  std::unordered_map<std::uint64_t, int> by_patch_;
  std::array<std::vector<Layer>, kMaxStep + 1> unused_;  // by step, all cells without data
  std::uint64_t bytes_ = 0, unused_bytes_ = 0;
  std::uint64_t last_key_ = 0;
  int last_ = kUnwanted;
  bool has_last_ = false;
};

/// Widens `rows` to hold row `b`.
inline void touch(RowRange& rows, int b) {
  if (rows.empty()) {
    rows = {b, b + 1};
    return;
  }
  rows.begin = std::min(rows.begin, b);
  rows.end = std::max(rows.end, b + 1);
}

}  // namespace apgm::observe

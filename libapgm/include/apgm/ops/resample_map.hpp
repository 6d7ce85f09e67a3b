#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apgm/core/source.hpp"
#include "apgm/ops/run.hpp"

namespace apgm {

/// The step wanted for a layer; nullopt: the layer is not wanted. Must give the same answer every time.
using StepRule = std::function<std::optional<int>(const LayerInfo& layer)>;

struct ResampleOptions {
  /// At most one of the three. None: every layer keeps its step.
  std::optional<double> resolution_m;  ///< Frame::step_for of this cell size, for every layer
  std::optional<int> step;             ///< for every layer
  StepRule rule;                       ///< for each layer on its own, with `TypeId`s of the source

  std::vector<std::string> layers;  ///< names of the types to resample; empty: all. The others pass unchanged
  std::optional<Policy> policy;     ///< for these types in place of their own; the result's types carry it
  std::optional<std::int64_t> edge_um;                  ///< regrid to this patch edge
  std::optional<std::array<std::int64_t, 2>> datum_um;  ///< and to this datum (x, y)
  std::uint64_t max_memory_bytes = 0;  ///< what the plan of a regridding may take; 0: no bound

  /// Members added to the parameters told in the history; values are JSON.
  std::map<std::string, std::string> told;
};

/// What a resampling did to the known cells of the native layers. A cell's loss is how far it changed by
/// being put into the cell of the result that covers it:
///  - evidence: the greatest |BetP(h) before - BetP(h) after| over the hypotheses h, in [0, 1];
///  - real channels: the greatest |before - after| over the channels that hold a number, in the channels'
///    unit; of counts (kSum), `after` is the even share of the native cell.
/// Only merging loses: merge after split is the identity, so cells of split layers count for `obstacles`
/// only.
struct ResampleLoss {
  std::uint64_t known_cells = 0;  ///< native cells with data in layers that were merged
  double sum = 0;                 ///< of the losses of these cells
  double most = 0;                ///< the greatest of them
  /// Occupancy: native cells with BetP(O) > 0.5 in whose place the result has BetP(O) <= 0.5. Merging by
  /// kExclusive, kMin and kProduct gives none; kConditional and kMedian none with m(O) > 0.5.
  std::uint64_t obstacles = 0;

  double mean() const { return known_cells == 0 ? 0.0 : sum / static_cast<double>(known_cells); }
  void add(const ResampleLoss& other);
};

/// One layer of the source that was or was not brought to another step.
struct ResampledLayer {
  PatchIndex patch;
  TypeId type = 0;
  int from = 0;
  std::optional<int> to;  ///< nullopt: dropped
  ResampleLoss loss;
  bool emptied = false;  ///< came out without data
};

struct ResampleReport {
  struct OfType {
    std::uint64_t layers_merged = 0;
    std::uint64_t layers_split = 0;
    std::uint64_t layers_unchanged = 0;
    std::uint64_t layers_dropped = 0;    ///< not wanted by the rule
    std::uint64_t layers_regridded = 0;  ///< of the new grid; the four above are then 0, and a plan
                                         ///< counts those that will come out without data as well
    /// Of the merged, split and unchanged: came out without data, so that the result does not hold them.
    /// 0 in a plan, and for regridded maps
    std::uint64_t layers_emptied = 0;
    std::uint64_t cells_before = 0;
    std::uint64_t cells_after = 0;  ///< in a plan, layers that will come out without data included
    ResampleLoss loss;              ///< zero in a plan, and for regridded maps
    ResampleLoss worst;             ///< of the layer with the greatest mean loss, the first of equals
    PatchIndex worst_patch;         ///< its patch; says nothing where worst.sum is 0
  };
  std::vector<OfType> types;          ///< by TypeId
  std::uint64_t patches_dropped = 0;  ///< no layer of which is wanted
  /// Some layer of which is wanted, but none came out with data; 0 in a plan, and for regridded maps.
  std::uint64_t patches_emptied = 0;
  std::uint64_t layers_stored = 0;  ///< passed on as stored bytes; 0 in a plan
};

/// Brings the layers of a map to other steps, by the policy of their type (paper, Sec. III-B, R(l, r);
/// docs/theory.md, "Resampling"): finer layers are merged, coarser ones split.
///
/// The plan is made from the source's header and index: no cell is read. The source must outlive it.
/// Regridding (edge_um, datum_um) resamples by area weights, once, from the native cells to the step that is
/// asked for; its loss is not measured.
class ResamplePlan {
 public:
  /// @throws Error{kInvalidArgument} on a layer the source does not have, a policy that does not fit a type,
  /// a
  ///         resolution, edge or datum out of range; {kLimit} if a step lies outside 0..11 or a layer would
  ///         exceed Layer::kMaxBytes
  ResamplePlan(const PatchSource& source, ResampleOptions options);
  ~ResamplePlan();
  ResamplePlan(ResamplePlan&&) noexcept;
  ResamplePlan& operator=(ResamplePlan&&) noexcept;

  /// That of the source with the new frame and policies, and one more entry "resample" in the history.
  const MapHeader& header() const;
  /// What `run` will do, without losses.
  const ResampleReport& expected() const;

  /// Streams the resampled map to a sink made for header(). Layers that keep their step pass as stored bytes.
  /// The caller calls PatchSink::finish.
  ///
  /// Guarantees: same parcels and same report for any thread count (losses are summed in one fixed order in
  /// each layer, then over layers in key order); memory does not grow with the number of cells.
  /// @param watch  called for every layer in key order, from one thread at a time; may throw to stop. Not
  ///               called for regridded maps
  /// @throws Error{kCancelled}, {kLimit} if the budget does not hold one patch, and whatever source, sink and
  ///         `watch` throw
  ResampleReport run(PatchSink& sink, const RunOptions& run = {},
                     const std::function<void(const ResampledLayer&)>& watch = {}) const;

  struct State;  ///< private to the library

 private:
  std::unique_ptr<const State> state_;
};

}  // namespace apgm

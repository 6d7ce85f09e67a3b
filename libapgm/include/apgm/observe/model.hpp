#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "apgm/core/layer.hpp"
#include "apgm/fuse/combine.hpp"
#include "apgm/observe/measurement.hpp"
#include "apgm/observe/ray.hpp"

namespace apgm {

/// Exclusive inverse sensor model in the manner of Nuss et al. (docs/theory.md, "Measurement models"): a cell
/// with returns gets m(O) = 1 - prod (1 - occ_max exp(-d^2 / 2 sigma^2)) with d from each return to the
/// cell's centre, m(F) = 0 whatever crosses it; a cell that is only crossed gets m(F), falling linearly with
/// the distance of its centre from the sensor.
struct NussModel {
  double occ_max = 0.7;  ///< m(O) of a return at the centre of its cell, in [0, 1)
  /// > 0. Where the half diagonal of a cell is larger, that counts: a return leaves m(O) >= occ_max e^(-1/2)
  /// wherever in its cell it lies, so that obstacles do not vanish from coarse layers.
  double sigma_m = 0.1;
  double free_max = 0.4;     ///< m(F) at the sensor, in [0, 1)
  double free_range_m = 80;  ///< where m(F) has fallen to 0, > 0
  friend bool operator==(const NussModel&, const NussModel&) = default;
};

/// Free evidence also in occupied cells, in the manner of Richter et al.: of R returns in and T passages
/// through a cell, m(O) = p_fn^T (1 - p_fp^R), m(F) = p_fp^R (1 - p_fn^T). A beam passes through each cell it
/// crosses but the one it ends in.
struct RichterModel {
  double p_fn = 0.8;  ///< a passage misses an obstacle with this probability, in (0, 1)
  double p_fp = 0.1;  ///< a return is false with this probability, in (0, 1)
  friend bool operator==(const RichterModel&, const RichterModel&) = default;
};

/// Each pixel of class k adds lambda_k = -ln(1 - rho); the masses follow from docs/theory.md, "Evidence".
struct CameraModel {
  double rho = 0.06;        ///< relevance of a pixel for its class, in (0, 1)
  double max_range_m = 40;  ///< pixels this far from the camera, or farther, are not used
  friend bool operator==(const CameraModel&, const CameraModel&) = default;
};

enum class ModelKind : std::uint8_t { kNuss, kRichter };

/// Everything a sensor set-up fixes: which layers come from what, and how. Read from YAML (parse_models).
struct Models {
  ModelKind kind = ModelKind::kNuss;
  NussModel nuss;
  RichterModel richter;
  RangeLimits limits;
  std::string occupancy_layer = "occupancy";
  CameraModel camera;
  std::string semantic_layer = "semantics";
  std::vector<std::string> classes{"Road", "Marking", "Blocked"};

  /// `exclusive` for Nuss, `conditional` for Richter: the policy of a single measurement. Without a slab.
  LayerType occupancy_type() const;
  LayerType semantic_type() const;
  /// @throws Error{kInvalidArgument} that names the key and its range
  void check() const;
};

/// Reads the parameters; keys as in docs/observe.md, absent ones keep their defaults.
/// @param name  of the text, for messages
/// @throws Error{kInvalidArgument} with line and key on an unknown key, a wrong type or a value out of range
Models parse_models(std::string_view yaml, std::string_view name);

/// A layer that a measurement gave, and the rows that may hold data (the others do not).
struct ObservedLayer {
  PatchIndex patch;
  RowRange rows;
  Layer cells;
};

/// Turns measurements into layers, each patch at its own step. Reuses its memory from call to call: the
/// layers stay valid until the next call. One thread an object.
///
/// Guarantees: layers come in curve_key order, none is vacuous, all bear the stamp of their measurement; same
/// bytes on every machine; masses valid and below 1 (at most 1 - 2^-24: no beam is certain).
class Observer {
 public:
  static constexpr std::uint64_t kMaxBytes = std::uint64_t{4} << 30;

  /// @param max_bytes  of values that one measurement may fill, those kept from earlier ones counted
  /// @throws Error as Models::check
  Observer(const Frame& frame, Models models, std::uint64_t max_bytes = kMaxBytes);
  ~Observer();
  Observer(Observer&&) noexcept;
  Observer& operator=(Observer&&) noexcept;

  const Models& models() const;
  /// The occupancy layer of one scan (paper, grid measurement model).
  /// @param step_of  asked once per patch that a beam meets
  /// @throws Error{kInvalidArgument|kLimit} if the origin is not finite or outside all patches, {kLimit} if a
  ///         step is not in 0..11, over_budget() if the layers exceed max_bytes. The observer can be used
  ///         again
  std::span<const ObservedLayer> observe(const RangeScan& scan, const StepOf& step_of);
  /// The semantic layer of one image. Errors as above.
  std::span<const ObservedLayer> observe(const LabelledGround& image, const StepOf& step_of);
  /// Ends the use of the layers that were handed out, and keeps at most so many bytes of memory for the next.
  void trim(std::uint64_t most_bytes);
  /// Readings of all calls so far that were not used: not finite; outside the map's limits, beams beyond
  /// 1000 km, unknown labels; pixels beyond the camera's range (as no_return). Patches without a step do not
  /// count.
  const Skipped& skipped() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace apgm

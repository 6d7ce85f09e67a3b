#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apgm/core/map.hpp"
#include "apgm/core/map_changes.hpp"
#include "apgm/core/patch_store.hpp"
#include "apgm/fuse/combine.hpp"
#include "apgm/observe/model.hpp"
#include "apgm/observe/profile.hpp"

namespace apgm {

struct MapperOptions {
  /// Between the map and a measurement. Real channels have no conflict to settle: kDempster and kYager take
  /// the mean of the two for them, so that each new measurement has half the weight of a cell.
  Rule rule = Rule::kDempster;
  /// Cell size where no profile is set.
  double cell_m = 0.1;
  /// Share of a cell's evidence that is left after a second (paper, discounting m^alpha): m <- alpha^t m, in
  /// (0, 1]; 1: nothing is forgotten. Time counts in whole ticks, of the powers of two of a second (1/512 s
  /// at least) the longest that leaves 0.99, so masses lie within a hundredth of alpha^t m. A mass below
  /// 2^-24 becomes 0; a layer without any data left is dropped. Real channels do not age.
  double ageing_per_s = 1.0;
  /// After each fusion and each change of the cell size m(Omega) of an observed cell is at least this (less
  /// 1e-6), masses keep their ratio; in [0, 0.5]. Without it float32 rounds m(Omega) to 0 after some thirty
  /// agreeing scans, and no later scan can change the cell.
  double min_unknown = 0.02;
  /// Most values of layers in memory, bytes; 0: no bound. Needs a store. Beyond it the least recently
  /// observed patches go to the store, until an eighth is free; during a call the patch in hand may come on
  /// top. What a profile requires must fit: the call that finds it does not throws Error{kLimit}, see
  /// `Mapper`.
  ///
  /// Besides: the cells of one measurement, of which a quarter of the bound, at most 64 MiB, is kept from
  /// call to call; memory of layers that left, to be used again, an eighth of the bound, at most 32 MiB; a
  /// layer to resample to, and where a measurement has other steps than the map or is not fully trusted two
  /// more; some 150 bytes for each patch in the store.
  std::uint64_t max_memory_bytes = 0;
  /// Most values that the cells of one measurement may take, bytes, those kept from earlier ones counted;
  /// 0: as much as max_memory_bytes, 64 MiB at least (4 GiB without a bound). What needs more throws
  /// over_budget() with what it needs.
  std::uint64_t max_measurement_bytes = 0;
};

/// What one call of a Mapper did and what the map then holds, by TypeId of its header.
struct MapperReport {
  struct OfType {
    std::uint64_t layers = 0;  ///< in memory after the call
    std::uint64_t cells = 0;
    std::uint64_t bytes = 0;        ///< of values
    std::uint64_t cells_fused = 0;  ///< by this call, rows that were combined
    /// Time this call took; not part of any result. Ageing, resampling and bringing back count as fusion.
    double observe_s = 0, fuse_s = 0;
  };
  std::uint64_t patches = 0;
  std::uint64_t total_conflicts = 0;  ///< cells with K = 1 in this call
  std::uint64_t patches_dropped = 0;  ///< left the requirements (to the store, if there is one)
  std::uint64_t layers_resampled = 0;
  std::vector<OfType> types;
};

/// The vehicle-side map (paper, Sec. III): measurements go in, a fused adaptive patched grid map comes out
/// that follows the vehicle and the requirements.
///
/// Without a profile every observed patch is kept at one cell size. With one, per patch and type: the layer
/// exists where the profile wants it round the vehicle's last position, at r_req; existing layers are split
/// or merged when r_req changes; layers and patches that are no longer wanted leave: to the store, whence
/// they come back when they are wanted again, or, without a store, for good. A new profile holds from the
/// next call of move_to or add on. Layers without data do not exist.
///
/// Guarantees: same map for the same calls on every machine; memory and store together hold the same layers
/// whatever `max_memory_bytes` is, unless it is too small for a call, which throws Error{kLimit}: where a
/// measurement fills more than it may, nothing of it is fused; where a profile requires more, what came
/// before stays done, and each further call throws until the profile, or where the vehicle is, requires less.
/// No layer is lost by an error: if a store fails (Error{kOutput}), what it should have taken stays in
/// memory. One thread.
class Mapper {
 public:
  /// @param frame     of the map
  /// @param models    give the layer types; the map's occupancy type is `conditional`, since it fuses many
  /// scans
  /// @param store     empty, of the same frame; outlives the mapper and takes its types from it; nullptr:
  /// none
  /// @throws Error{kInvalidArgument} on options out of range, max_memory_bytes without a store
  Mapper(const Frame& frame, const Models& models, const MapperOptions& options = {},
         PatchStore* store = nullptr);
  ~Mapper();
  Mapper(Mapper&&) noexcept;
  Mapper& operator=(Mapper&&) noexcept;

  /// @throws Error as Profile::check; the old profile then stays
  void set_profile(std::optional<Profile> profile);

  /// The vehicle is at `vehicle` at `stamp_ns`: ages the map, drops and resamples layers. A stamp before the
  /// last one is taken as the last one.
  /// @throws Error{kInvalidArgument|kLimit} on a position that is not finite or outside all patches; {kLimit}
  ///         if what the profile requires exceeds max_memory_bytes
  MapperReport move_to(Point vehicle, std::int64_t stamp_ns);

  /// Observes and fuses one measurement; ages to its stamp. With a profile, call move_to first: what lies
  /// outside the requirements is not observed.
  /// @param alpha  trust in the source, in [0, 1]: discounted by this first; 0: nothing is fused
  /// @throws Error{kInvalidArgument} on alpha, on a profile without a move_to, or as Observer
  MapperReport add(const RangeScan& scan, float alpha = 1.0f);
  MapperReport add(const LabelledGround& image, float alpha = 1.0f);
  /// Fuses layers made elsewhere (a sensor module): types are matched by name, unknown ones are added; same
  /// frame. They are brought to r_req first; without a profile to the finer of the two.
  /// The time of the measurement is its header's stamp; 0: that of the last call.
  /// @throws Error{kInvalidArgument} on alpha, on a profile without a move_to: before anything happens;
  ///         {kIncompatible} as fused_types, or if the frames differ; Error as PatchSource::load and
  ///         canonicalise: patches before that one are fused then
  MapperReport add(const PatchSource& measurement, float alpha = 1.0f);

  /// The patches in memory: with a profile the required ones, else all since the last `flush` or eviction.
  const Map& map() const;
  /// What changed in map() since the last call (at first: since it was empty): apply(take_changes()) to a
  /// copy of map() as it was gives map() as it is. Layers that were fused, aged or resampled count as
  /// changed.
  MapChanges take_changes();
  /// Gives all patches to the store, and brings all that rest there to the age of the last call.
  /// @throws Error{kInvalidArgument} without a store
  void flush();
  /// Readings that the Observer did not use.
  const Skipped& skipped() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace apgm

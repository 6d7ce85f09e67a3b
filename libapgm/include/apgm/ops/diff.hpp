#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apgm/core/source.hpp"
#include "apgm/ops/run.hpp"

namespace apgm {

/// When two maps count as different.
enum class DiffLevel : std::uint8_t {
  kBytes,   ///< the content of a layer differs; cells are read only where a source knows no content hash
  kCells,   ///< any bit of a cell differs, or the step of a layer
  kBelief,  ///< a value of a cell differs by more than DiffOptions::tolerance
};

/// One cell as both maps have it. A state is kUnknown (no data), kUndecided (data, but no greatest mass; real
/// channels: any data) or kFirst + the hypothesis of the greatest mass, which is that of the greatest BetP.
struct CellDiff {
  static constexpr std::uint8_t kUnknown = 0, kUndecided = 1, kFirst = 2;

  std::uint8_t before = kUnknown;
  std::uint8_t after = kUnknown;
  bool differs = false;  ///< as the level says
  float conflict = 0;    ///< K of Dempster's rule between both, in [0, 1]

  friend bool operator==(const CellDiff&, const CellDiff&) = default;
};

/// Receives one layer type of both maps, cell by cell: from one thread at a time, in key order. Layers that
/// are equal in both are read and received, too.
class DiffSink {
 public:
  virtual ~DiffSink() = default;
  /// @param step   the coarser of both
  /// @param cells  4^step, rows of cells as in Layer
  virtual void put(PatchIndex patch, int step, std::span<const CellDiff> cells) = 0;
};

struct DiffInput {
  const PatchSource* source = nullptr;
  std::string name;  ///< for messages
};

struct DiffOptions {
  DiffLevel level = DiffLevel::kCells;
  double tolerance = 0;             ///< kBelief: >= 0, in the unit of the channel
  std::vector<std::string> layers;  ///< names; empty: all
  std::optional<Box> box;           ///< only patches that share area with it
  bool regions = false;             ///< find the regions that changed
  DiffSink* cells = nullptr;
  std::string cells_layer;  ///< the type `cells` is told of
};

/// A number of cells and the area they cover.
struct CellTally {
  std::uint64_t cells = 0;
  double area_m2 = 0;
  friend bool operator==(const CellTally&, const CellTally&) = default;
};

/// Of a quantity over cells. Mean and greatest value are 0 where there is no cell.
struct Spread {
  double mean = 0;
  double max = 0;
  friend bool operator==(const Spread&, const Spread&) = default;
};

/// What differs in the layers of one type (docs/diff.md has the formulas).
///
/// Figures are taken over the `compared` cells: those known in either map, in layers whose content differs at
/// all. A layer that one map lacks counts as one without data. Layers of two steps are compared at the
/// coarser one, the finer resampled by the policy its own map declares.
struct TypeDiff {
  LayerType type;  ///< as the reference declares it, else the other

  std::uint64_t layers_added = 0;    ///< in the other alone
  std::uint64_t layers_removed = 0;  ///< in the reference alone
  std::uint64_t layers_changed = 0;  ///< in both, different as the level says
  std::uint64_t layers_equal = 0;    ///< in both, not different
  std::uint64_t layers_of_two_steps = 0;
  std::uint64_t layers_of_two_stamps = 0;

  CellTally compared;
  CellTally changed;           ///< different as the level says; the sum of the six kinds below
  CellTally learned;           ///< unknown -> known
  CellTally forgotten;         ///< known -> unknown
  CellTally free_to_occupied;  ///< occupancy: BetP(O) < 0.5 -> BetP(O) > 0.5
  CellTally occupied_to_free;  ///< occupancy: the way back
  CellTally class_changed;     ///< other evidence: another hypothesis has the greatest mass
  CellTally adjusted;          ///< known in both, none of the above

  // Evidence.
  Spread betp_delta;          ///< of a cell: the greatest |BetP(h) - BetP'(h)| over the hypotheses h
  double max_mass_delta = 0;  ///< greatest |m - m'| of a stored channel
  double kl_divergence = 0;   ///< sum over the cells of KL(BetP || BetP') in nats, reference first
  Spread jousselme;           ///< distance of Jousselme, in [0, 1]
  Spread conflict;            ///< K of Dempster's rule between both, in [0, 1]

  /// Of real channels, over cells where both hold a number: |v - v'|.
  struct Channel {
    std::uint64_t cells = 0;
    Spread delta;
    friend bool operator==(const Channel&, const Channel&) = default;
  };
  std::vector<Channel> channels;  ///< by channel; empty for evidence

  friend bool operator==(const TypeDiff&, const TypeDiff&) = default;
};

/// Cells that changed and lie together: the tight box around them, on borders of cells.
struct DiffRegion {
  Box box;
  double area_m2 = 0;  ///< of the changed cells; where several types changed, of the one with most
  friend bool operator==(const DiffRegion&, const DiffRegion&) = default;
};

struct DiffReport {
  bool different = false;  ///< as the level says
  std::uint64_t patches_added = 0;
  std::uint64_t patches_removed = 0;
  std::uint64_t patches_changed = 0;  ///< in both, with a layer added, removed or changed
  std::uint64_t patches_equal = 0;
  std::vector<TypeDiff> types;      ///< of both maps, sorted by name
  std::vector<DiffRegion> regions;  ///< most area first, then from south to north and west to east
  /// What is not cells and differs: "history", "policy of layer 'occupancy'"; never a difference of the maps.
  std::vector<std::string> header_differences;

  friend bool operator==(const DiffReport&, const DiffReport&) = default;
};

/// KL(p || q) takes no probability below this: a cell that is certain in one map keeps the sum finite.
inline constexpr double kLeastProbability = 1e-6;

/// What differs between two maps. Types are matched by name. Layers whose content hashes are equal are not
/// read, save for `options.cells`; memory does not grow with the maps but by 24 bytes a changed patch (with
/// `options.regions`), and the index of a map that is shifted.
///
/// Frames: edges and frame ids must be equal, EPSG codes too where both are known. A datum of `other` that
/// lies whole cells (of its coarsest layer) away is shifted exactly, which is told as a note.
///
/// Guarantees: same report for any thread count and ISA.
/// diff(b, a) is the mirror of diff(a, b): added and removed, learned and forgotten, and both ways between
/// free and occupied trade places; all other figures but kl_divergence are the same to the last bit where
/// datums are equal.
///
/// @throws Error{kIncompatible} with a hint if the frames or the spaces of two types of one name do not fit;
///         {kInvalidArgument} if no map has a type of a name, the box or the tolerance cannot be used, or
///         regions or cells are asked for at kBytes; {kLimit} if the budget does not hold one patch;
///         {kCancelled}; whatever the sources throw
DiffReport diff(const DiffInput& reference, const DiffInput& other, const DiffOptions& options = {},
                const RunOptions& run = {});

}  // namespace apgm

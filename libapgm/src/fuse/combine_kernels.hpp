#pragma once

#include <cstddef>
#include <cstdint>

namespace apgm::fuse {

/// Masses over {O, F} in two planes.
struct OccupancyPlanes {
  const float* o = nullptr;
  const float* f = nullptr;
};
struct OccupancyOut {
  float* o = nullptr;
  float* f = nullptr;
};

/// Dempster's rule of two occupancy layers: the hot path of every merge. `out` may be an input.
/// @return cells of total conflict
std::uint64_t dempster_two(OccupancyPlanes a, OccupancyPlanes b, OccupancyOut out, std::size_t cells);
/// The same, and K of each cell.
std::uint64_t dempster_two(OccupancyPlanes a, OccupancyPlanes b, OccupancyOut out, float* k,
                           std::size_t cells);

/// Cells of several layers side by side, small enough to stay in the first-level cache. Value `row` of the
/// cells of an input stands in `width` neighbouring floats.
inline constexpr std::size_t kBlock = 256;
using Rows = float*;  // [rows][kBlock]

/// Orders the inputs in each cell by their rows as tuples: with it a fold over them no longer depends on the
/// order of the inputs. Any total order does; the values' bits are compared as whole numbers.
/// @param rows  [inputs][width][kBlock]
void sort_inputs(Rows rows, std::size_t inputs, std::size_t width);

/// Row of m(Omega) from `hypotheses` rows of masses.
void omit_masses(const float* rows, std::size_t hypotheses, float* omega);

/// True (1) where an input holds data: a mass, or m(Omega) that is not 1.
void holds_belief(const float* rows, std::size_t hypotheses, std::int32_t* holds);

/// acc <- acc (+) in by the conjunctive rule on [hypotheses + 1][kBlock] rows, m(Omega) last; normalised
/// (Dempster) or not (Yager). `held` counts the inputs with data that are in acc; where acc or in is vacuous
/// the bits of the other stay.
/// @param k  nullptr, or [kBlock]: receives the conflict of all folds so far
void fold(Rows acc, const float* in, std::size_t hypotheses, bool normalise, std::int32_t* held,
          const std::int32_t* holds, float* k);

/// After the last fold: cuts the masses of cells that two or more inputs hold to a float32 sum of at most 1.
void bound_masses(Rows acc, std::size_t hypotheses, const std::int32_t* held);

/// m <- alpha m, and m(Omega) <- 1 - alpha (1 - m(Omega)), the form that keeps 1 exact.
void discount_masses(float* m, float alpha, std::size_t cells);
void discount_omega(float* m, float alpha, std::size_t cells);

}  // namespace apgm::fuse

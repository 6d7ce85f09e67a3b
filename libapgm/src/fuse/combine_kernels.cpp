#include "fuse/combine_kernels.hpp"

#include "fuse/combine_loops.hpp"
#include "fuse/dempster_loops.hpp"

namespace apgm::fuse {

APGM_CLONES std::uint64_t dempster_two(OccupancyPlanes a, OccupancyPlanes b, OccupancyOut out,
                                       std::size_t cells) {
  return loop::dempster_two<false>({a, b, out, nullptr}, cells);
}

APGM_CLONES std::uint64_t dempster_two(OccupancyPlanes a, OccupancyPlanes b, OccupancyOut out, float* k,
                                       std::size_t cells) {
  return loop::dempster_two<true>({a, b, out, k}, cells);
}

APGM_CLONES void sort_inputs(Rows rows, std::size_t inputs, std::size_t width) {
  loop::sort_inputs(rows, inputs, width);
}

APGM_CLONES void omit_masses(const float* rows, std::size_t hypotheses, float* omega) {
  loop::omit_masses(rows, hypotheses, omega);
}

APGM_CLONES void holds_belief(const float* rows, std::size_t hypotheses, std::int32_t* holds) {
  loop::holds_belief(rows, hypotheses, holds);
}

APGM_CLONES void bound_masses(Rows acc, std::size_t hypotheses, const std::int32_t* held) {
  loop::bound_masses(acc, hypotheses, held);
}

APGM_CLONES void fold(Rows acc, const float* in, std::size_t hypotheses, bool normalise, std::int32_t* held,
                      const std::int32_t* holds, float* k) {
  if (k != nullptr) loop::fold_conflict(acc, in, hypotheses, held, holds, k, normalise);
  loop::fold(acc, in, hypotheses, normalise, held, holds);
}

APGM_CLONES void discount_masses(float* m, float alpha, std::size_t cells) {
  for (std::size_t i = 0; i < cells; ++i) m[i] *= alpha;
}

APGM_CLONES void discount_omega(float* m, float alpha, std::size_t cells) {
  for (std::size_t i = 0; i < cells; ++i) m[i] = 1.0f - alpha * (1.0f - m[i]);
}

}  // namespace apgm::fuse

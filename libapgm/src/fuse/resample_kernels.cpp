#include "fuse/resample_kernels.hpp"

#include "fuse/resample_loops.hpp"

namespace apgm::fuse {

APGM_CLONES void merge_rows(Policy policy, const RowPair& in, float* o, float* f, std::size_t n,
                            std::size_t rows) {
  loop::merge_rows(policy, in, o, f, n, rows);
}

APGM_CLONES void split_cells(Policy policy, int levels, const float* o, const float* f, float* out_o,
                             float* out_f, std::size_t n) {
  loop::split_cells(policy, levels, o, f, out_o, out_f, n);
}

APGM_CLONES void spread_row(const float* from, int levels, float* to, std::size_t n) {
  loop::spread_row(from, levels, to, n);
}

}  // namespace apgm::fuse

#include "apgm/fuse/resample.hpp"

#include <cassert>

#include "apgm/fuse/resampled_view.hpp"
#include "fuse/cells.hpp"

namespace apgm {

void resample(const Layer& in, const LayerType& type, int step, Layer& out) {
  assert(&in != &out);
  ResampledView view(in, type, step);
  if (step == in.step()) {
    out = in;
    return;
  }
  out.reshape(in.channels(), step);
  out.stamp_ns = in.stamp_ns;
  view.make({0, out.side()}, fuse::cells_of(out));
}

}  // namespace apgm

#include "apgm/observe/ray.hpp"

#include <cstdlib>

#include "apgm/core/error.hpp"
#include "observe/segment_walk.hpp"

namespace apgm {
namespace {

observe::GridPoint checked_point(const Frame& frame, Point p) {
  if (!observe::is_finite(p)) {
    throw Error(ErrorCode::kInvalidArgument, "an end of a ray is not a finite number");
  }
  const auto g = observe::grid_point(frame, p);
  if (!g) throw Error(ErrorCode::kLimit, "an end of a ray lies outside all patch indices");
  return *g;
}

int checked_step(int step) {
  if (step < 0 || step > kMaxStep) throw Error(ErrorCode::kLimit, "a resolution step lies in 0..11");
  return step;
}

}  // namespace

RayWalker::RayWalker(const Frame& frame) : frame_(frame), cells_(observe::SegmentWalk::kMaxCells) {
  frame_.check();
}

void RayWalker::walk(Point from, Point to, const StepOf& step_of,
                     const std::function<void(const RayRun& run, bool last)>& visit) {
  const observe::GridPoint p = checked_point(frame_, from), q = checked_point(frame_, to);
  constexpr std::int64_t kMax = observe::SegmentWalk::kMaxLength_nm;
  if (std::abs(q.x - p.x) > kMax || std::abs(q.y - p.y) > kMax) {
    throw Error(ErrorCode::kLimit, "a ray is longer than 1000 km");
  }
  observe::SegmentWalk segment(p, q, observe::edge_nm(frame_));
  for (bool last = false; !last;) {
    last = segment.in_last_patch();
    const PatchIndex patch = segment.patch();
    const std::optional<int> step = step_of(patch);
    const auto cells = segment.cross(checked_step(step.value_or(0)), cells_.data());
    if (step) visit({patch, *step, cells}, last);
  }
}

}  // namespace apgm

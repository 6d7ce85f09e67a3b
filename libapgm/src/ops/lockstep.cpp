#include "lockstep.hpp"

#include <algorithm>
#include <utility>

#include "apgm/core/error.hpp"

namespace apgm::ops {

PatchLane::PatchLane(const PatchSource& source, std::string name, const std::optional<PatchRange>& range)
    : name_(std::move(name)), cursor_(source.patches(range)) {
  step();
}

void PatchLane::take(PatchInfo& out) {
  std::swap(out, ahead_);
  const std::uint64_t last = key_;
  step();
  if (!ended_ && key_ <= last) {
    throw Error(ErrorCode::kDamaged, "the patches of '" + name_ + "' are not in key order");
  }
}

void PatchLane::step() {
  ended_ = !cursor_->next(ahead_);
  if (!ended_) key_ = curve_key(ahead_.patch);
}

bool Lockstep::next() {
  const bool l = !left_lane_.ended(), r = !right_lane_.ended();
  has_left_ = l && (!r || left_lane_.key() <= right_lane_.key());
  has_right_ = r && (!l || right_lane_.key() <= left_lane_.key());
  if (has_left_) left_lane_.take(left_);
  if (has_right_) right_lane_.take(right_);
  return has_left_ || has_right_;
}

const LayerInfo* find_layer(std::span<const LayerInfo> layers, TypeId type) {
  const auto it = std::ranges::lower_bound(layers, type, {}, &LayerInfo::type);
  return it != layers.end() && it->type == type ? &*it : nullptr;
}

}  // namespace apgm::ops

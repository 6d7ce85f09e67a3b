#include "resample_view.hpp"

#include <cmath>

#include "transfer.hpp"

namespace apgm::ops {

PolicyView::PolicyView(const PatchSource& source, TypeTable types)
    : source_(source), header_(source.header()) {
  for (std::size_t t = 0; t < types.size(); ++t) {
    const auto id = static_cast<TypeId>(t);
    same_.push_back(header_.types[id].same_backgrounds(types[id]));
  }
  header_.types = std::move(types);
}

void PolicyView::load(const LayerInfo& info, Layer& out) const {
  source_.load(info, out);
  if (same_[info.type]) return;
  const LayerType& type = header_.types[info.type];
  const bool to_counts = type.policy == Policy::kSum;
  for (int c = 0; c < out.channels(); ++c) {
    const float background = type.background(c);
    for (float& v : out.plane(c)) {
      if (to_counts ? std::isnan(v) : v == 0.0f) v = background;
    }
  }
}

bool PolicyView::load_stored(const LayerInfo& info, StoredLayer& out) const {
  return same_[info.type] && source_.load_stored(info, out);
}

}  // namespace apgm::ops

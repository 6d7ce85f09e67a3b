#include "layouts/cell_pool.hpp"

#include <algorithm>
#include <limits>

namespace apgm::layouts {
namespace {

using fuse::Pool;

double neutral(Pool pool) {
  constexpr double kInf = std::numeric_limits<double>::infinity();
  return pool == Pool::kLeast ? kInf : pool == Pool::kGreatest ? -kInf : 0.0;
}

}  // namespace

CellPool::CellPool(const CellSchema& schema) : schema_(schema) {
  for (const LayerType& type : schema.types()) {
    OfType& t = types_.emplace_back();
    t.model = fuse::CellModel::make(type);
    t.sums.resize(t.model->pools().size());
    t.values.resize(t.sums.size());
  }
  clear();
}

void CellPool::clear() {
  for (OfType& t : types_) {
    t.has_data = false;
    for (std::size_t i = 0; i < t.sums.size(); ++i) t.sums[i] = neutral(t.model->pools()[i]);
  }
}

void CellPool::add(const float* cell, double of_source, double of_target) {
  for (std::size_t t = 0; t < types_.size(); ++t) {
    const auto type = static_cast<TypeId>(t);
    add(type, cell + schema_.first(type), of_source, of_target);
  }
}

void CellPool::add(TypeId type, const float* channels, double of_source, double of_target) {
  OfType& t = types_[type];
  if (!t.model->measure(channels, t.values.data())) return;
  t.has_data = true;
  for (std::size_t i = 0; i < t.sums.size(); ++i) {
    const double value = t.values[i];
    switch (t.model->pools()[i]) {
      case Pool::kExtensive:
        t.sums[i] += of_source * value;
        break;
      case Pool::kIntensive:
        t.sums[i] += of_target * value;
        break;
      case Pool::kLeast:
        t.sums[i] = std::min(t.sums[i], value);
        break;
      case Pool::kGreatest:
        t.sums[i] = std::max(t.sums[i], value);
        break;
    }
  }
}

void CellPool::restore(float* cell) const {
  for (std::size_t t = 0; t < types_.size(); ++t) {
    const auto type = static_cast<TypeId>(t);
    restore(type, cell + schema_.first(type));
  }
}

void CellPool::restore(TypeId type, float* channels) const {
  const OfType& t = types_[type];
  if (t.has_data) {
    t.model->restore(t.sums.data(), channels);
    // No evidence may come out as -0.
    for (std::size_t c = 0; c < schema_.types()[type].channels.size(); ++c) channels[c] += 0.0f;
    return;
  }
  const float* background = schema_.background().data() + schema_.first(type);
  std::copy_n(background, schema_.types()[type].channels.size(), channels);
}

}  // namespace apgm::layouts

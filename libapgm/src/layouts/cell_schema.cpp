#include <cstring>

#include "apgm/core/error.hpp"
#include "apgm/layouts/layout.hpp"

namespace apgm {

CellSchema::CellSchema(TypeTable types) : types_(std::move(types)) {
  if (types_.empty()) throw Error(ErrorCode::kInvalidArgument, "a layout needs at least one layer type");
  for (const LayerType& type : types_) {
    first_.push_back(static_cast<int>(background_.size()));
    for (std::size_t c = 0; c < type.channels.size(); ++c) {
      background_.push_back(type.background(static_cast<int>(c)));
    }
  }
}

bool CellSchema::is_known(const float* cell) const {
  return std::memcmp(cell, background_.data(), background_.size() * sizeof(float)) != 0;
}

bool CellSchema::is_known(const float* cell, TypeId type) const {
  const int at = first_[type];
  return std::memcmp(cell + at, background_.data() + at, types_[type].channels.size() * sizeof(float)) != 0;
}

}  // namespace apgm

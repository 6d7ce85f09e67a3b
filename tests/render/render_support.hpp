#pragma once

#include <gtest/gtest.h>

#include <ostream>
#include <utility>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/core/map.hpp"
#include "apgm/ops/render.hpp"

namespace apgm {

inline void PrintTo(const Colour& c, std::ostream* out) {
  *out << "rgb(" << int{c.red} << ", " << int{c.green} << ", " << int{c.blue} << ")";
}

namespace test {

inline constexpr Colour kOccupied{20, 20, 24};
inline constexpr Colour kFree{250, 250, 246};
inline constexpr Colour kUnknown{132, 148, 168};

inline MapHeader header_of(std::vector<LayerType> types) {
  MapHeader header;
  header.types = TypeTable(std::move(types));
  return header;
}

inline Map occupancy_map(Policy policy = Policy::kConditional) {
  return Map(header_of({LayerType::occupancy("occupancy", policy)}));
}

inline void occupy(Map& map, PatchIndex patch, int step, CellIndex cell, float mass = 1.0f) {
  map.layer(patch, 0, step).at(0, cell) = mass;
}
inline void release(Map& map, PatchIndex patch, int step, CellIndex cell, float mass = 1.0f) {
  map.layer(patch, 0, step).at(1, cell) = mass;
}

template <class Body>
ErrorCode code_of(const Body& body) {
  try {
    body();
  } catch (const Error& error) {
    EXPECT_FALSE(error.message().empty());
    return error.code();
  }
  ADD_FAILURE() << "nothing was thrown";
  return ErrorCode::kDamaged;
}

}  // namespace test
}  // namespace apgm

#include <gmock/gmock.h>

#include <cstdint>
#include <random>

#include "scan.hpp"

namespace apgm::format {
namespace {

TEST(CurveKeyTest, IsUndoneByTheTablesReadBackwardsNearAndFar) {
  std::mt19937_64 rng(7);
  const std::int32_t edges[] = {-65'537, -65'536, -65'535, -1,        0,        1,
                                65'534,  65'535,  65'536,  INT32_MIN, INT32_MAX};
  for (const std::int32_t x : edges) {
    for (const std::int32_t y : edges) EXPECT_EQ(patch_of_key(curve_key({x, y})), (PatchIndex{x, y}));
  }
  for (int i = 0; i < 20'000; ++i) {
    const PatchIndex patch{static_cast<std::int32_t>(rng()) >> (rng() % 32),
                           static_cast<std::int32_t>(rng()) >> (rng() % 32)};
    ASSERT_EQ(patch_of_key(curve_key(patch)), patch) << patch.x << ' ' << patch.y << " (seed 7)";
  }
}

}  // namespace
}  // namespace apgm::format

#include "apgm/core/layer.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

TEST(LayerTest, StartsVacuousWithAlignedPlanes) {
  const LayerType type = LayerType::semantic("s", {"a", "b", "c"});
  for (int step = 0; step <= 9; ++step) {
    const Layer layer(type, step);
    EXPECT_EQ(layer.cells(), std::size_t{1} << (2 * step));
    EXPECT_TRUE(is_vacuous(layer, type));
    EXPECT_TRUE(is_canonical(layer, type));
    for (int c = 0; c < 4; ++c) {
      EXPECT_EQ(reinterpret_cast<std::uintptr_t>(layer.plane(c).data()) % 64, 0u);
      EXPECT_EQ(layer.plane(c).size(), layer.cells());
    }
  }
}

TEST(LayerTest, CellAIsAlongXInTheLowestRow) {
  Layer layer(LayerType::occupancy(), 3);
  layer.at(0, {5, 0}) = 0.5f;
  layer.at(1, {2, 1}) = 0.25f;
  EXPECT_EQ(layer.plane(0)[5], 0.5f);
  EXPECT_EQ(layer.plane(1)[10], 0.25f);
}

TEST(LayerTest, RefusesStepsAndSizesBeyondTheLimits) {
  EXPECT_THROW(Layer(LayerType::occupancy(), 12), Error);
  EXPECT_THROW(Layer(LayerType::occupancy(), -1), Error);
  EXPECT_NO_THROW(Layer(LayerType::semantic("s", {"a", "b", "c"}), 11));  // 64 MiB exactly
  EXPECT_THROW(Layer(LayerType::semantic("s", {"a", "b", "c", "d"}), 11), Error);
}

TEST(LayerTest, ResetKeepsTheMemoryThatSuffices) {
  Layer layer(LayerType::occupancy(), 6);
  const float* memory = layer.plane(0).data();
  layer.reset(LayerType::occupancy(), 4);
  EXPECT_EQ(layer.plane(0).data(), memory);
  layer.reset(LayerType::occupancy(), 6);
  EXPECT_EQ(layer.plane(0).data(), memory);
}

TEST(LayerTest, CopiesAreDeepAndEqual) {
  Layer a(LayerType::occupancy(), 1);
  a.plane(0)[2] = 0.5f;
  Layer b = a;
  EXPECT_TRUE(same_cells(a, b));
  b.plane(1)[0] = 0.1f;
  EXPECT_FALSE(same_cells(a, b));
  EXPECT_EQ(a.plane(1)[0], 0.0f);
}

TEST(LayerTest, MovedFromLayerCanBeUsedAgain) {
  Layer a(LayerType::occupancy(), 3);
  a.plane(0)[1] = 0.5f;
  const Layer b = std::move(a);
  EXPECT_EQ(b.plane(0)[1], 0.5f);
  a.reset(LayerType::occupancy(), 2);
  EXPECT_EQ(a.plane(1).size(), 16u);
}

TEST(CanonicaliseTest, RefusesWhatIsNotAMass) {
  const LayerType type = LayerType::occupancy();
  for (const float bad : {-1e-9f, 1.0000001f, std::numeric_limits<float>::quiet_NaN(),
                          std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()}) {
    Layer layer(type, 4);
    layer.plane(1)[77] = bad;
    EXPECT_FALSE(is_canonical(layer, type)) << bad;
    EXPECT_THROW(canonicalise(layer, type), Error) << bad;
  }
}

TEST(CanonicaliseTest, RefusesSumsAboveOneAndSemanticsThatDoNotSumToOne) {
  Layer occupancy(LayerType::occupancy(), 2);
  occupancy.plane(0)[3] = 0.7f;
  occupancy.plane(1)[3] = 0.300001f;
  EXPECT_NO_THROW(canonicalise(occupancy, LayerType::occupancy()));  // within float32 rounding
  occupancy.plane(1)[3] = 0.30001f;
  EXPECT_THROW(canonicalise(occupancy, LayerType::occupancy()), Error);
  const LayerType type = LayerType::semantic("s", {"a", "b"});
  Layer semantic(type, 2);
  semantic.plane(0)[0] = 0.5f;
  EXPECT_THROW(canonicalise(semantic, type), Error);
  semantic.plane(2)[0] = 0.5f;
  EXPECT_NO_THROW(canonicalise(semantic, type));
}

TEST(CanonicaliseTest, TurnsMinusZeroIntoZeroAndAnyNanIntoOne) {
  const LayerType type = LayerType::real("v", {"x"});
  Layer layer(type, 1);
  layer.plane(0)[0] = -0.0f;
  layer.plane(0)[1] = -std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(is_canonical(layer, type));
  canonicalise(layer, type);
  EXPECT_TRUE(is_canonical(layer, type));
  EXPECT_FALSE(std::signbit(layer.plane(0)[0]));
  layer.plane(0)[0] = std::numeric_limits<float>::infinity();
  EXPECT_THROW(canonicalise(layer, type), Error);
}

}  // namespace
}  // namespace apgm

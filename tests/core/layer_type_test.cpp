#include "apgm/core/layer_type.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

TEST(LayerTypeTest, OccupancyHasImplicitOmega) {
  const LayerType type = LayerType::occupancy();
  EXPECT_NO_THROW(type.check());
  EXPECT_TRUE(type.is_evidence() && type.is_occupancy());
  EXPECT_FALSE(type.stores_omega());
  EXPECT_EQ(type.background(0), 0.0f);
}

TEST(LayerTypeTest, SemanticStoresOmegaLast) {
  const LayerType type = LayerType::semantic("semantic", {"Road", "Marking", "Blocked"});
  EXPECT_NO_THROW(type.check());
  EXPECT_THAT(type.channels, testing::ElementsAre("Road", "Marking", "Blocked", "Omega"));
  EXPECT_TRUE(type.stores_omega());
  EXPECT_EQ(type.background(2), 0.0f);
  EXPECT_EQ(type.background(3), 1.0f);
}

TEST(LayerTypeTest, RealChannelsHaveNoDataValues) {
  EXPECT_TRUE(std::isnan(LayerType::real("velocity", {"vx", "vy"}).background(1)));
  EXPECT_EQ(LayerType::real("hits", {"n"}, Policy::kSum).background(0), 0.0f);
}

TEST(LayerTypeTest, TwoClassesWithOmegaAreNotOccupancy) {
  EXPECT_FALSE(LayerType::semantic("s", {"a", "b"}).is_occupancy());
}

TEST(LayerTypeTest, CheckRefusesWhatDoesNotFit) {
  const auto refuses = [](LayerType type) { EXPECT_THROW(type.check(), Error) << type.name; };
  refuses(LayerType::occupancy(""));
  refuses(LayerType::occupancy("has space"));
  refuses(LayerType::occupancy("-sign"));
  refuses(LayerType::occupancy(std::string(65, 'a')));
  refuses(LayerType::occupancy("o", Policy::kEvidence));
  refuses(LayerType::real("v", {"x"}, Policy::kConditional));
  refuses(LayerType::real("v", {}));
  refuses({"one", {"A"}, {"A"}, Policy::kMean, {}});
  refuses({"short", {"A", "B", "C"}, {"A", "B"}, Policy::kMean, {}});
  LayerType slab = LayerType::occupancy("slab");
  slab.slab = Slab{5, 5};
  refuses(slab);
}

TEST(LayerTypeTest, SameMeaningIsSameSpaceAndBackground) {
  const LayerType mean = LayerType::real("height", {"z"});
  LayerType other = mean;
  other.policy = Policy::kMinimum;  // both without data are no number
  EXPECT_TRUE(mean.same_meaning(other));
  other.policy = Policy::kSum;  // without data: 0
  EXPECT_TRUE(mean.same_space(other));
  EXPECT_FALSE(mean.same_backgrounds(other));
  EXPECT_FALSE(mean.same_meaning(other));
  EXPECT_TRUE(other.same_meaning(other));
  other = mean;
  other.slab = Slab{0, 1};
  EXPECT_FALSE(mean.same_meaning(other));
  EXPECT_TRUE(LayerType::occupancy("o", Policy::kMin).same_meaning(LayerType::occupancy("o", Policy::kMean)));
  EXPECT_FALSE(LayerType::occupancy("o").same_meaning(LayerType::occupancy("p")));
  EXPECT_FALSE(LayerType::semantic("o", {"a", "b"}).same_meaning(LayerType::semantic("o", {"a", "c"})));
}

TEST(PolicyTest, NamesComeBack) {
  for (int p = 0; p <= static_cast<int>(Policy::kMaximum); ++p) {
    EXPECT_EQ(policy_from(to_string(static_cast<Policy>(p))), static_cast<Policy>(p));
  }
  EXPECT_FALSE(policy_from("bayes"));
}

TEST(TypeTableTest, IdsFollowFromTheNamesAlone) {
  const TypeTable a({LayerType::occupancy("b"), LayerType::occupancy("a"), LayerType::occupancy("c")});
  const TypeTable b({LayerType::occupancy("c"), LayerType::occupancy("b"), LayerType::occupancy("a")});
  EXPECT_EQ(a, b);
  EXPECT_EQ(a.find("b"), TypeId{1});
  EXPECT_FALSE(a.find("d"));
}

TEST(TypeTableTest, RefusesTwoTypesOfOneNameAndTooMany) {
  EXPECT_THROW(TypeTable({LayerType::occupancy("a"), LayerType::real("a", {"x"})}), Error);
  std::vector<LayerType> many;
  for (int i = 0; i < 4097; ++i) many.push_back(LayerType::occupancy("t" + std::to_string(i)));
  EXPECT_THROW(TypeTable{many}, Error);
}

}  // namespace
}  // namespace apgm

// Theorems and values of docs/theory.md that hold across policies and types; those of single policies are in
// resample_test.cpp and evidence_test.cpp.
#include <gtest/gtest.h>

#include <algorithm>

#include "apgm/fuse/combine.hpp"
#include "apgm/fuse/resample.hpp"
#include "layers.hpp"

namespace apgm {
namespace {

using test::occupancy_of;
using test::Random;

Layer resampled(const Layer& in, const LayerType& type, int step) {
  Layer out;
  resample(in, type, step, out);
  return out;
}

LayerType occupancy(Policy policy) { return LayerType::occupancy("occupancy", policy); }
LayerType semantic(Policy policy) {
  return LayerType::semantic("surface", {"Road", "Marking", "Blocked"}, policy);
}
LayerType real(Policy policy) { return LayerType::real("numbers", {"x", "y"}, policy); }

std::vector<LayerType> every_type() {
  return {occupancy(Policy::kExclusive),
          occupancy(Policy::kConditional),
          occupancy(Policy::kMin),
          occupancy(Policy::kProduct),
          occupancy(Policy::kMedian),
          occupancy(Policy::kDempster),
          occupancy(Policy::kMean),
          semantic(Policy::kEvidence),
          semantic(Policy::kMean),
          real(Policy::kMean),
          real(Policy::kSum),
          real(Policy::kMinimum),
          real(Policy::kMaximum)};
}

/// Cells of any kind the type may hold. `full`: no cell without data.
Layer sample(const LayerType& type, int step, Random& random, bool full = false) {
  if (type.policy == Policy::kExclusive) return test::random_exclusive(step, random);
  if (type.policy == Policy::kDempster) {
    // No total conflict, which has no level to agree on.
    Layer layer(type, step);
    for (std::size_t i = 0; i < layer.cells(); ++i) {
      layer.plane(0)[i] = 0.5f * test::uniform(random);
      layer.plane(1)[i] = 0.4f * test::uniform(random);
    }
    return layer;
  }
  if (type.is_occupancy()) return test::random_occupancy(step, random);
  if (type.is_evidence()) return test::random_semantic(type, step, random);
  Layer layer = test::random_real(type, step, random);
  for (int c = 0; full && c < layer.channels(); ++c) {
    for (float& v : layer.plane(c)) v = 10 * test::uniform(random) - 5;
  }
  return layer;
}

class EveryType : public testing::TestWithParam<LayerType> {
 protected:
  /// Numbers up to 5 and their sums; masses are below 1.
  float tolerance(float masses) const { return GetParam().is_evidence() ? masses : 20 * masses; }
};

class EveryTypeByLevels : public EveryType {};    // but kMedian, taken from the native level
class EveryTypeThatSplits : public EveryType {};  // but kDempster, which combines what it has copied

TEST_P(EveryType, MergeIsCommutative) {
  const LayerType& type = GetParam();
  Random random(101);
  for (int round = 0; round < 100; ++round) {
    const int step = 1 + static_cast<int>(random() % 2);
    const Layer in = sample(type, step, random);
    // 4x4 in two levels: any order of the cells gives the same, but rounding.
    std::vector<std::size_t> order(in.cells());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::shuffle(order.begin(), order.end(), random);
    Layer shuffled = in;
    for (int c = 0; c < in.channels(); ++c) {
      for (std::size_t i = 0; i < order.size(); ++i) shuffled.plane(c)[i] = in.plane(c)[order[i]];
    }
    ASSERT_LE(test::difference(resampled(in, type, 0), resampled(shuffled, type, 0)), tolerance(2e-6f))
        << "seed 101, round " << round;
  }
}

TEST_P(EveryTypeByLevels, LevelsAgree) {
  const LayerType& type = GetParam();
  Random random(102);
  for (int round = 0; round < 20; ++round) {
    // Real means are level-consistent where all cells hold numbers.
    Layer in = sample(type, 4, random, type.policy == Policy::kMean);
    // Below the greatest Lambda that m(Omega) can hold, 103: there all is certain.
    if (type.policy == Policy::kEvidence) discount(in, type, 0.3f);
    Layer level = in;
    for (int step = 3; step >= 0; --step) {
      level = resampled(level, type, step);
      // A sum of 256 numbers up to 5, rounded at each level.
      const float most = type.policy == Policy::kSum ? 1e-3f : tolerance(1e-5f);
      ASSERT_LE(test::difference(level, resampled(in, type, step)), most) << "seed 102, round " << round;
    }
  }
}

TEST_P(EveryTypeThatSplits, MergeAfterSplitIsTheIdentity) {
  const LayerType& type = GetParam();
  Random random(103);
  for (int levels = 1; levels <= 3; ++levels) {
    const Layer in = sample(type, 3, random);
    const Layer back = resampled(resampled(in, type, 3 + levels), type, 3);
    EXPECT_LE(test::difference(in, back), tolerance(5e-6f)) << "seed 103, levels " << levels;
  }
}

TEST_P(EveryType, SplitAfterMergeIsNotTheIdentity) {
  const LayerType& type = GetParam();
  Random random(104);
  const Layer in = sample(type, 3, random);
  EXPECT_GT(test::difference(in, resampled(resampled(in, type, 2), type, 3)), 0.01f);
}

TEST_P(EveryType, VacuousStaysVacuous) {
  for (const int step : {0, 1, 3, 5}) {
    EXPECT_TRUE(is_vacuous(resampled(Layer(GetParam(), 3), GetParam(), step), GetParam()));
  }
}

std::vector<LayerType> types_but(Policy policy) {
  std::vector<LayerType> types = every_type();
  std::erase_if(types, [&](const LayerType& type) { return type.policy == policy; });
  return types;
}
std::string name_of(const testing::TestParamInfo<LayerType>& test) {
  return test.param.name + "_" + std::string(to_string(test.param.policy));
}
INSTANTIATE_TEST_SUITE_P(All, EveryType, testing::ValuesIn(every_type()), name_of);
INSTANTIATE_TEST_SUITE_P(All, EveryTypeByLevels, testing::ValuesIn(types_but(Policy::kMedian)), name_of);
INSTANTIATE_TEST_SUITE_P(All, EveryTypeThatSplits, testing::ValuesIn(types_but(Policy::kDempster)), name_of);

TEST(Theorem, MedianConservesLambdaAndLosesNoObstacle) {
  const LayerType type = occupancy(Policy::kMedian);
  Random random(105);
  Layer in = test::random_occupancy(4, random);
  for (int step = 0; step < 4; ++step) {
    const Layer out = resampled(in, type, step);
    const int n = 1 << (4 - step);
    for (int b = 0; b < 16; ++b) {
      for (int a = 0; a < 16; ++a) ASSERT_GE(out.at(0, {a / n, b / n}), in.at(0, {a, b}));
    }
  }
  for (float& o : in.plane(0)) o = 0.5f * test::uniform(random);
  std::ranges::fill(in.plane(1), 0.0f);
  const long double want = test::sum_lambda(in);
  for (const int step : {3, 5, 6}) {
    EXPECT_NEAR(static_cast<double>(test::sum_lambda(resampled(in, type, step)) / want), 1, 1e-5) << step;
  }
}

TEST(Theorem, MedianTakesTheMeanOfTheTwoInTheMiddle) {
  const LayerType type = occupancy(Policy::kMedian);
  const Layer out = resampled(occupancy_of(1, {{0, .1f}, {0, .9f}, {.5f, .2f}, {0, .3f}}), type, 0);
  EXPECT_NEAR(out.plane(0)[0], .5, 1e-7);
  EXPECT_NEAR(out.plane(1)[0], .5 * .35, 1e-7);  // phi: .1, .9, .4, .3
}

/// Lambda of each class, summed over a layer.
std::vector<double> sum_evidence(const Layer& layer) {
  std::vector<double> sums(3);
  for (std::size_t i = 0; i < layer.cells(); ++i) {
    double known = 0;
    for (int k = 0; k < 3; ++k) known += static_cast<double>(layer.plane(k)[i]);
    if (known == 0) continue;
    const double omega = static_cast<double>(layer.plane(3)[i]);
    const double lambda = known < 0.5 ? -std::log1p(-known) : -std::log(omega);
    for (std::size_t k = 0; k < 3; ++k)
      sums[k] += static_cast<double>(layer.plane(static_cast<int>(k))[i]) / known * lambda;
  }
  return sums;
}

TEST(Theorem, EvidenceOfEachClassIsConserved) {
  const LayerType type = semantic(Policy::kEvidence);
  Random random(106);
  const Layer in = test::random_semantic(type, 4, random);
  const std::vector<double> want = sum_evidence(in);
  for (const int step : {3, 2, 5, 6}) {
    const std::vector<double> got = sum_evidence(resampled(in, type, step));
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(got[k] / want[k], 1, 1e-5) << step;
  }
}

TEST(Theorem, DempsterLosesTheMarkingThatEvidenceKeeps) {
  const LayerType type = semantic(Policy::kEvidence);
  Layer road(type, 0), marking(type, 0), out;
  road.plane(0)[0] = marking.plane(1)[0] = .9f;
  road.plane(3)[0] = marking.plane(3)[0] = .1f;
  combine(std::array<const Layer*, 4>{&road, &road, &road, &marking}, type, Rule::kDempster, out);
  EXPECT_NEAR(out.plane(0)[0], .990, 5e-4);
  EXPECT_NEAR(out.plane(1)[0], .009, 5e-4);
}

TEST(Theorem, DempsterDoesNotCommuteWithResampling) {
  // Hence resample first, then fuse: two sensors, one sees the obstacle in one cell of four, one sees all
  // free.
  const LayerType type = occupancy(Policy::kConditional);
  const Layer a = occupancy_of(1, {{.9f, 0}, {0, .8f}, {0, .8f}, {0, .8f}});
  const Layer b = occupancy_of(1, {{0, .5f}, {.9f, 0}, {0, .5f}, {0, .5f}});
  Layer fused, resampled_first;
  combine(std::array<const Layer*, 2>{&a, &b}, type, Rule::kDempster, fused);
  const Layer x = resampled(a, type, 0), y = resampled(b, type, 0);
  combine(std::array<const Layer*, 2>{&x, &y}, type, Rule::kDempster, resampled_first);
  EXPECT_GT(test::difference(resampled(fused, type, 0), resampled_first), 0.01f);
}

TEST(Theorem, HalvingAndAddingKeepTheDigitsOfTinyMasses) {
  const LayerType type = occupancy(Policy::kConditional);
  for (const double m : {1e-12, 1e-9, 1e-6, 1e-3, 0.5, 0.9}) {
    for (int levels = 1; levels <= 6; ++levels) {
      const int n = 1 << (2 * levels);
      const auto whole = static_cast<float>(m);
      const double part = -std::expm1(std::log1p(-static_cast<double>(whole)) / n);
      const float split = resampled(occupancy_of(0, {{whole, 0}}), type, levels).plane(0)[0];
      EXPECT_NEAR(split / part, 1, 1e-6) << m << " over " << n;
      Layer parts(type, levels);
      std::ranges::fill(parts.plane(0), split);
      const double sum = -std::expm1(n * std::log1p(-static_cast<double>(split)));
      EXPECT_NEAR(resampled(parts, type, 0).plane(0)[0] / sum, 1, 1e-6) << m << " from " << n;
    }
  }
  EXPECT_EQ(1.0f - std::pow(1.0f - 1e-8f, 1.0f / 4), 0.0f);  // the formula as it is written loses all
}

TEST(Theorem, DividingByOneMinusKWouldLoseDigits) {
  const Layer a = occupancy_of(0, {{.9999f, 0}}), b = occupancy_of(0, {{0, .9998f}});
  Layer out;
  combine(std::array<const Layer*, 2>{&a, &b}, occupancy(Policy::kConditional), Rule::kDempster, out);
  const double p = static_cast<double>(.9999f), q = static_cast<double>(.9998f);
  const double want = p * (1 - q) / (1 - p * q);
  const float k = .9999f * .9998f;
  const float naive = .9999f * (1.0f - .9998f) / (1.0f - k);
  EXPECT_NEAR(out.plane(0)[0], want, 2e-7);
  EXPECT_GT(std::abs(static_cast<double>(naive) - want), 1e-5);
}

/// BetP(O) > BetP(F).
bool rather_occupied(float o, float f) { return o > f; }

class Vanishing : public testing::TestWithParam<Policy> {};

TEST_P(Vanishing, NoCellThatIsRatherOccupiedBecomesFree) {
  const LayerType type = occupancy(GetParam());
  Random random(107);
  for (int round = 0; round < 50; ++round) {
    const Layer in = GetParam() == Policy::kExclusive ? test::random_exclusive(3, random)
                                                      : test::random_occupancy(3, random);
    for (int step = 0; step < 3; ++step) {
      const Layer out = resampled(in, type, step);
      const int n = 1 << (3 - step);
      for (int b = 0; b < 8; ++b) {
        for (int a = 0; a < 8; ++a) {
          if (!rather_occupied(in.at(0, {a, b}), in.at(1, {a, b}))) continue;
          const CellIndex merged{a / n, b / n};
          ASSERT_TRUE(rather_occupied(out.at(0, merged), out.at(1, merged))) << "seed 107, round " << round;
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, Vanishing, testing::Values(Policy::kExclusive, Policy::kMin, Policy::kProduct),
                         [](const auto& test) { return std::string(to_string(test.param)); });

TEST(Theorem, ConditionalKeepsCellsWhoseOccupiedMassIsAboveOneHalf) {
  // m(O) > 1/2 stays above m(F) by merged m(O) >= m(O) alone. Weaker evidence among free cells may not: the
  // mean of phi is theirs.
  const LayerType type = occupancy(Policy::kConditional);
  const Layer strong = resampled(occupancy_of(1, {{.51f, .49f}, {0, 1}, {0, 1}, {0, 1}}), type, 0);
  EXPECT_TRUE(rather_occupied(strong.plane(0)[0], strong.plane(1)[0]));
  const Layer weak = resampled(occupancy_of(1, {{.3f, .2f}, {0, 1}, {0, 1}, {0, 1}}), type, 0);
  EXPECT_FALSE(rather_occupied(weak.plane(0)[0], weak.plane(1)[0]));
  EXPECT_EQ(weak.plane(0)[0], .3f);
  const Layer lost =
      resampled(occupancy_of(1, {{.9f, 0}, {0, .9f}, {0, .9f}, {0, .9f}}), occupancy(Policy::kDempster), 0);
  EXPECT_FALSE(rather_occupied(lost.plane(0)[0], lost.plane(1)[0]));
}

}  // namespace
}  // namespace apgm

#include "apgm/fuse/resample.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "apgm/core/error.hpp"
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

LayerType with(Policy policy) { return LayerType::occupancy("occupancy", policy); }

constexpr Policy kLevelConsistent[] = {Policy::kExclusive, Policy::kConditional, Policy::kMin,
                                       Policy::kProduct};

void expect_cell(const Layer& layer, double o, double f, double tolerance = 1e-6) {
  EXPECT_NEAR(layer.plane(0)[0], o, tolerance);
  EXPECT_NEAR(layer.plane(1)[0], f, tolerance);
}

TEST(ResampleOccupancy, MergeGivesTheReferenceValues) {
  for (const Policy policy : kLevelConsistent) {
    const auto merged = [&](const Layer& in) { return resampled(in, with(policy), 0); };
    expect_cell(merged(occupancy_of(1, {{.5f, 0}, {0, 0}, {0, 0}, {0, 0}})), .5, 0);
    expect_cell(merged(occupancy_of(1, {{.9f, 0}, {.9f, 0}, {.9f, 0}, {.9f, 0}})), .9999, 0);
    expect_cell(merged(occupancy_of(1, {{.1f, 0}, {.1f, 0}, {.1f, 0}, {.1f, 0}})), .3439, 0);
    const Layer wall = occupancy_of(1, {{.9f, 0}, {0, .8f}, {0, .8f}, {0, .8f}});
    expect_cell(merged(wall), .9, policy == Policy::kConditional ? .06 : 0);
    const Layer free = occupancy_of(1, {{0, .8f}, {0, .8f}, {0, .8f}, {0, .8f}});
    expect_cell(merged(free), 0, policy == Policy::kProduct ? .4096 : .8);
  }
  const Layer mixed = occupancy_of(1, {{.5f, .25f}, {.2f, .4f}, {0, 0}, {0, 1}});
  expect_cell(resampled(mixed, with(Policy::kConditional), 0), .6, .2);
  expect_cell(resampled(mixed, with(Policy::kMin), 0), .6, 0);
}

TEST(ResampleOccupancy, SplitGivesTheReferenceValues) {
  for (const Policy policy : kLevelConsistent) {
    const auto split = [&](float o, int levels) {
      return resampled(occupancy_of(0, {{o, 0}}), with(policy), levels).plane(0)[0];
    };
    EXPECT_NEAR(split(.9f, 1), .437659, 1e-6);
    EXPECT_NEAR(split(.5f, 1), .159104, 1e-6);
    EXPECT_NEAR(split(.99f, 1), .683772, 1e-6);
    EXPECT_NEAR(split(.9f, 2), .134036, 1e-6);
    EXPECT_NEAR(split(.5f, 3), .0107720, 1e-7);
    EXPECT_EQ(split(1.0f, 4), 1.0f);
  }
}

TEST(ResampleOccupancy, SplitKeepsTinyMassesExact) {
  const double m = 1e-12;
  const float part = resampled(occupancy_of(0, {{1e-12f, 0}}), with(Policy::kConditional), 6).plane(0)[0];
  EXPECT_NEAR(part / (m / 4096), 1, 1e-6);
}

TEST(ResampleOccupancy, DempsterLosesTheObstacleAsInThePaper) {
  const Layer in = occupancy_of(1, {{.9f, 0}, {0, .9f}, {0, .9f}, {0, .9f}});
  expect_cell(resampled(in, with(Policy::kDempster), 0), .0089, .990, 1e-4);
  expect_cell(resampled(in, with(Policy::kConditional), 0), .9, .0675);
}

TEST(ResampleOccupancy, MedianIsNotLevelConsistent) {
  // The counter-example of docs/theory.md: groups {0,1,1,1}, {0,1,1,1}, {0,0,0,0}, {0,0,0,0} of free masses.
  Layer in(with(Policy::kMedian), 2);
  for (const std::size_t i : {1u, 4u, 5u, 3u, 6u, 7u}) in.plane(1)[i] = 1.0f;
  const Layer at_once = resampled(in, with(Policy::kMedian), 0);
  const Layer by_levels = resampled(resampled(in, with(Policy::kMedian), 1), with(Policy::kMedian), 0);
  expect_cell(at_once, 0, 0);
  expect_cell(by_levels, 0, .5);
}

TEST(ResampleOccupancy, SplitCopiesFreeShare) {
  expect_cell(resampled(occupancy_of(0, {{0, .7f}}), with(Policy::kMedian), 2), 0, .7);
  expect_cell(resampled(occupancy_of(0, {{.5f, .25f}}), with(Policy::kConditional), 1), .159104,
              .5 * (1 - .159104));
  expect_cell(resampled(occupancy_of(0, {{.4f, .3f}}), with(Policy::kMean), 2), .4, .3);
  expect_cell(resampled(occupancy_of(0, {{.4f, .3f}}), with(Policy::kDempster), 2), .4, .3);
}

class ResamplePolicy : public testing::TestWithParam<Policy> {
 protected:
  Layer sample(int step, Random& random) const {
    return GetParam() == Policy::kExclusive ? test::random_exclusive(step, random)
                                            : test::random_occupancy(step, random);
  }
};

TEST_P(ResamplePolicy, TwoLevelsAtOnceEqualOneByOne) {
  Random random(41);
  for (int round = 0; round < 20; ++round) {
    const Layer in = sample(5, random);
    Layer level = resampled(in, with(GetParam()), 4);
    for (int step = 3; step >= 0; --step) {
      level = resampled(level, with(GetParam()), step);
      EXPECT_LE(test::difference(level, resampled(in, with(GetParam()), step)), 1e-6f) << "round " << round;
    }
  }
}

TEST_P(ResamplePolicy, MergeDoesNotDependOnTheOrderOfCells) {
  Random random(42);
  for (int round = 0; round < 200; ++round) {
    Layer in = sample(1, random);
    const Layer first = resampled(in, with(GetParam()), 0);
    const auto swap_cells = [&](std::size_t i, std::size_t j) {
      for (int c = 0; c < 2; ++c) std::swap(in.plane(c)[i], in.plane(c)[j]);
    };
    swap_cells(0, random() % 4);
    swap_cells(1, 1 + random() % 3);
    swap_cells(2, 2 + random() % 2);
    EXPECT_LE(test::difference(first, resampled(in, with(GetParam()), 0)), 5e-7f) << "round " << round;
  }
}

TEST_P(ResamplePolicy, MergeAfterSplitIsTheIdentity) {
  Random random(43);
  for (int levels = 1; levels <= 4; ++levels) {
    const Layer in = sample(4, random);
    const Layer split = resampled(in, with(GetParam()), 4 + levels);
    EXPECT_EQ(test::invalid_cells(split), 0u);
    // The n-th power of m(F) multiplies the rounding of the split cells by n.
    const float tolerance = GetParam() == Policy::kProduct ? 1e-6f + std::ldexp(6e-8f, 2 * levels) : 1e-6f;
    EXPECT_LE(test::difference(in, resampled(split, with(GetParam()), 4)), tolerance) << levels;
  }
}

TEST_P(ResamplePolicy, KeepsMassesValidAndNoObstacleVanishes) {
  Random random(44);
  for (int round = 0; round < 50; ++round) {
    const Layer in = test::random_occupancy(4, random);
    for (int step = 0; step < 4; ++step) {
      const Layer out = resampled(in, with(GetParam()), step);
      ASSERT_EQ(test::invalid_cells(out), 0u) << "seed 44, round " << round;
      const int n = 1 << (4 - step);
      for (int b = 0; b < 16; ++b) {
        for (int a = 0; a < 16; ++a) {
          ASSERT_GE(out.at(0, {a / n, b / n}), in.at(0, {a, b}));
        }
      }
    }
  }
}

TEST_P(ResamplePolicy, ConservesTheSumOfLambda) {
  Random random(45);
  Layer in(with(GetParam()), 5);
  for (float& o : in.plane(0)) o = 0.9f * test::uniform(random);
  const long double want = test::sum_lambda(in);
  for (const int step : {4, 3, 6, 8}) {
    const long double got = test::sum_lambda(resampled(in, with(GetParam()), step));
    // Merged cells near m(O) = 1 keep few digits of lambda in float32.
    const double tolerance = step == 3 ? 1e-3 : 1e-5;
    EXPECT_NEAR(static_cast<double>(got / want), 1, tolerance) << step;
  }
}

TEST_P(ResamplePolicy, VacuousStaysVacuous) {
  const Layer none(with(GetParam()), 3);
  for (const int step : {0, 1, 3, 5})
    EXPECT_TRUE(is_vacuous(resampled(none, with(GetParam()), step), with(GetParam())));
}

INSTANTIATE_TEST_SUITE_P(All, ResamplePolicy, testing::ValuesIn(kLevelConsistent),
                         [](const auto& test) { return std::string(to_string(test.param)); });

TEST(Resample, ManyMediansAndDempstersStayValid) {
  Random random(46);
  for (const Policy policy : {Policy::kMedian, Policy::kDempster, Policy::kMean}) {
    const Layer in = test::random_occupancy(5, random);
    for (const int step : {0, 2, 4, 6}) EXPECT_EQ(test::invalid_cells(resampled(in, with(policy), step)), 0u);
  }
}

TEST(Resample, SameStepCopiesAndStampStays) {
  Random random(47);
  Layer in = test::random_occupancy(3, random);
  in.stamp_ns = 42;
  for (const int step : {2, 3, 4}) EXPECT_EQ(resampled(in, with(Policy::kConditional), step).stamp_ns, 42);
  EXPECT_TRUE(same_cells(in, resampled(in, with(Policy::kConditional), 3)));
}

TEST(Resample, RefusesStepsOutOfRange) {
  Layer in(with(Policy::kConditional), 0), out;
  EXPECT_THROW(resample(in, with(Policy::kConditional), -1, out), Error);
  EXPECT_THROW(resample(in, with(Policy::kConditional), 12, out), Error);
}

TEST(ResampleReal, MeanTakesCellsWithData) {
  const LayerType type = LayerType::real("velocity", {"x"});
  Layer in(type, 1);
  in.plane(0)[1] = 2.0f;
  in.plane(0)[2] = 4.0f;
  EXPECT_EQ(resampled(in, type, 0).plane(0)[0], 3.0f);
  EXPECT_TRUE(is_vacuous(resampled(Layer(type, 2), type, 1), type));
  EXPECT_EQ(resampled(in, type, 2).at(0, {3, 1}), 2.0f);
}

TEST(ResampleReal, CountsAddAndAreShared) {
  const LayerType type = LayerType::real("points", {"n"}, Policy::kSum);
  Layer in(type, 1);
  for (std::size_t i = 0; i < 4; ++i) in.plane(0)[i] = static_cast<float>(i + 1);
  EXPECT_EQ(resampled(in, type, 0).plane(0)[0], 10.0f);
  EXPECT_EQ(resampled(in, type, 3).at(0, {0, 0}), 1.0f / 16);
  EXPECT_TRUE(same_cells(resampled(resampled(in, type, 4), type, 1), in));
}

TEST(ResampleReal, ExtremesTakeTheExtremes) {
  for (const auto& [policy, want] : {std::pair{Policy::kMinimum, -3.0f}, std::pair{Policy::kMaximum, 7.0f}}) {
    const LayerType type = LayerType::real("height", {"z"}, policy);
    Layer in(type, 1);
    in.plane(0)[0] = 7.0f;
    in.plane(0)[1] = -3.0f;
    EXPECT_EQ(resampled(in, type, 0).plane(0)[0], want);
    EXPECT_TRUE(same_cells(resampled(resampled(in, type, 3), type, 1), in));
  }
}

}  // namespace
}  // namespace apgm

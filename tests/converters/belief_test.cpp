#include "converters/common/belief.hpp"

#include <cmath>
#include <limits>
#include <random>

#include "tests/converters/support.hpp"

namespace apgm::converters {
namespace {

TEST(Belief, IsLeastCommitted) {
  EXPECT_EQ(masses_from_probability(0.75), (Masses{0.5f, 0}));
  EXPECT_EQ(masses_from_probability(0.25), (Masses{0, 0.5f}));
  EXPECT_EQ(masses_from_probability(0.5), Masses{});
  EXPECT_EQ(masses_from_probability(1), (Masses{1, 0}));
  EXPECT_EQ(masses_from_probability(0), (Masses{0, 1}));
}

TEST(Belief, LogOddsAgreeWithProbability) {
  for (double l = -12; l <= 12; l += 0.037) {
    const double p = 1 / (1 + std::exp(-static_cast<double>(static_cast<float>(l))));
    const Masses a = masses_from_log_odds(static_cast<float>(l)), b = masses_from_probability(p);
    EXPECT_NEAR(a.occupied, b.occupied, 1e-7) << l;
    EXPECT_NEAR(a.free, b.free, 1e-7) << l;
  }
}

TEST(Belief, TinyLogOddsAreNotLost) {
  EXPECT_FLOAT_EQ(masses_from_log_odds(2e-30f).occupied, 1e-30f);
  EXPECT_FLOAT_EQ(log_odds({0, 1e-30f}), -2e-30f);
  EXPECT_EQ(masses_from_log_odds(0), Masses{});
}

TEST(Belief, InfiniteLogOddsAreCertain) {
  const float inf = std::numeric_limits<float>::infinity();
  EXPECT_EQ(masses_from_log_odds(inf), (Masses{1, 0}));
  EXPECT_EQ(masses_from_log_odds(-inf), (Masses{0, 1}));
  EXPECT_EQ(log_odds({1, 0}), kMaxLogOdds);
  EXPECT_EQ(masses_from_log_odds(kMaxLogOdds), (Masses{1, 0}));
}

TEST(Belief, ProbabilitySurvivesTheRoundTrip) {
  std::mt19937 random(7);
  RecordProperty("seed", 7);
  std::uniform_real_distribution<float> draw(-15, 15);
  for (int i = 0; i < 20000; ++i) {
    const float l = draw(random);
    const auto probability = [](double x) { return 1 / (1 + std::exp(-x)); };
    const float back = log_odds(masses_from_log_odds(l));
    EXPECT_NEAR(probability(back), probability(l), 6e-8) << l;
  }
}

TEST(Belief, PignisticSharesTheUnknown) {
  EXPECT_DOUBLE_EQ(pignistic({0.5f, 0.25f}), 0.625);
  EXPECT_DOUBLE_EQ(pignistic({}), 0.5);
}

}  // namespace
}  // namespace apgm::converters

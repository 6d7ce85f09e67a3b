#include "apgm/core/portable_math.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace apgm {
namespace {

double ulps(double got, long double want) {
  const double rounded = std::fabs(static_cast<double>(want));
  const double unit = std::nextafter(rounded, INFINITY) - rounded;
  return static_cast<double>(std::fabs(static_cast<long double>(got) - want) /
                             static_cast<long double>(unit));
}

TEST(PortableMath, StaysWithinTwoUlpOfTheExactValue) {
  std::mt19937_64 random(31);
  const auto in = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
  for (int i = 0; i < 200'000; ++i) {
    for (const double x : {std::exp(in(-700, 700)), in(0.5, 2)}) {
      ASSERT_LE(ulps(portable::log(x), std::log(static_cast<long double>(x))), 2) << x;
    }
    for (const double x : {std::exp(in(-36, -0.01)) - 1, std::exp(in(-80, 5)), -std::exp(in(-80, -0.1))}) {
      ASSERT_LE(ulps(portable::log1p(x), std::log1p(static_cast<long double>(x))), 2) << x;
      ASSERT_LE(ulps(portable::expm1(x), std::expm1(static_cast<long double>(x))), 2) << x;
    }
    for (const double x : {in(-700, 700), in(-1, 1)}) {
      ASSERT_LE(ulps(portable::exp(x), std::exp(static_cast<long double>(x))), 2) << x;
    }
    for (const double x : {in(-7, 7), in(-1e5, 1e5), in(-1e-3, 1e-3)}) {
      ASSERT_LE(ulps(portable::sin(x), std::sin(static_cast<long double>(x))), 2) << x;
      ASSERT_LE(ulps(portable::cos(x), std::cos(static_cast<long double>(x))), 2) << x;
    }
  }
}

TEST(PortableMath, TakesSpecialValuesAsTheCLibraryDoes) {
  EXPECT_EQ(portable::log(0), -INFINITY);
  EXPECT_EQ(portable::log(1), 0);
  EXPECT_TRUE(std::isnan(portable::log(-1)));
  EXPECT_TRUE(std::isnan(portable::log(NAN)));
  EXPECT_EQ(portable::log(INFINITY), INFINITY);
  EXPECT_EQ(portable::log(5e-324), std::log(5e-324));
  EXPECT_EQ(portable::log1p(-1), -INFINITY);
  EXPECT_EQ(portable::log1p(0), 0);
  EXPECT_TRUE(std::isnan(portable::log1p(-1.5)));
  EXPECT_EQ(portable::exp(-INFINITY), 0);
  EXPECT_EQ(portable::exp(INFINITY), INFINITY);
  EXPECT_EQ(portable::exp(0), 1);
  EXPECT_EQ(portable::exp(-745), std::exp(-745.0));
  EXPECT_EQ(portable::expm1(-INFINITY), -1);
  EXPECT_EQ(portable::expm1(0), 0);
  EXPECT_EQ(portable::sin(0), 0);
  EXPECT_EQ(portable::cos(0), 1);
  EXPECT_TRUE(std::isnan(portable::sin(1e9)));
}

}  // namespace
}  // namespace apgm

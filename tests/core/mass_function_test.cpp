#include "apgm/core/mass_function.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <random>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

using Random = std::mt19937_64;
constexpr unsigned kSeed = 311;

/// Masses on a random choice of the subsets; some sets bare, some masses tiny.
MassFunction random_bba(int n, Random& random) {
  const Subset omega = (Subset{1} << n) - 1;
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<MassFunction::Focal> focal;
  double sum = 0;
  for (Subset a = 1; a <= omega; ++a) {
    if (a != omega && random() % 3 == 0) continue;
    const double v = random() % 4 == 0 ? std::pow(10.0, -12 * unit(random)) : unit(random);
    focal.push_back({a, v});
    sum += v;
  }
  for (auto& f : focal) f.mass /= sum;
  return MassFunction(n, focal);
}

/// The definition, over all tuples of focal sets at once: conjunction by mask, [0] is K.
std::vector<long double> all_products(std::span<const MassFunction> inputs) {
  const std::size_t sets = inputs[0].masses().size();
  std::vector<long double> out(sets, 0);
  std::size_t tuples = 1;
  for (std::size_t i = 0; i < inputs.size(); ++i) tuples *= sets;
  for (std::size_t t = 0; t < tuples; ++t) {
    std::size_t rest = t, met = sets - 1;
    long double product = 1;
    for (const MassFunction& m : inputs) {
      met &= rest % sets;
      product *= static_cast<long double>(m.masses()[rest % sets]);
      rest /= sets;
    }
    out[met] += product;
  }
  return out;
}

double difference(const MassFunction& a, const MassFunction& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.masses().size(); ++i)
    most = std::max(most, std::abs(a.masses()[i] - b.masses()[i]));
  return most;
}

template <class Call>
void expect_code(ErrorCode code, Call&& call) {
  try {
    call();
    ADD_FAILURE() << "no error";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), code) << e.what();
  }
}

constexpr Subset kA = 1, kB = 2, kC = 4;

TEST(MassFunction, RefusesWhatIsNoBba) {
  expect_code(ErrorCode::kLimit, [] { MassFunction(0); });
  expect_code(ErrorCode::kLimit, [] { MassFunction(9); });
  for (const auto& focal :
       std::vector<std::vector<MassFunction::Focal>>{{{kA, 0.5}},              // sums to less than 1
                                                     {{kA, 0.5}, {kB, 0.6}},   // and to more
                                                     {{kA, 1.5}, {kB, -0.5}},  // out of [0, 1]
                                                     {{kA, NAN}, {kB, 1}},     //
                                                     {{0, 0.1}, {kA, 0.9}},    // m(empty)
                                                     {{kA | kC, 1}}}) {        // outside the frame
    expect_code(ErrorCode::kInvalidArgument, [&] { MassFunction(2, focal); });
  }
  const MassFunction m(2);
  expect_code(ErrorCode::kInvalidArgument, [&] { m.bel(kC); });
  expect_code(ErrorCode::kInvalidArgument, [&] { m.discounted(1.01); });
  expect_code(ErrorCode::kInvalidArgument, [&] { m.discounted(NAN); });
  expect_code(ErrorCode::kInvalidArgument, [] { dempster_rule({}); });
  const std::array<MassFunction, 2> unlike{MassFunction(2), MassFunction(3)};
  expect_code(ErrorCode::kIncompatible, [&] { dempster_rule(unlike); });
  expect_code(ErrorCode::kIncompatible, [&] { yager_rule(unlike); });
}

TEST(MassFunction, VacuousKnowsNothing) {
  for (int n = 1; n <= 8; ++n) {
    const MassFunction m(n);
    EXPECT_TRUE(m.is_vacuous());
    for (Subset a = 1; a < m.frame(); ++a) {
      EXPECT_EQ(m.bel(a), 0);
      EXPECT_EQ(m.pl(a), 1);
      EXPECT_DOUBLE_EQ(m.betp(a), static_cast<double>(std::popcount(a)) / n);
    }
    EXPECT_EQ(m.bel(m.frame()), 1);
    EXPECT_EQ(m.pl(0), 0);
  }
}

TEST(MassFunction, BeliefPlausibilityAndBetPFollowTheirDefinitions) {
  Random random(kSeed);
  for (int round = 0; round < 200; ++round) {
    const int n = 1 + static_cast<int>(random() % 6);
    const MassFunction m = random_bba(n, random);
    double singletons = 0;
    for (Subset a = 0; a <= m.frame(); ++a) {
      double bel = 0, pl = 0, betp = 0;
      for (Subset b = 1; b <= m.frame(); ++b) {
        if ((a & b) == b) bel += m.mass(b);
        if ((a & b) != 0) pl += m.mass(b);
        betp += m.mass(b) * std::popcount(a & b) / std::popcount(b);
      }
      ASSERT_NEAR(m.bel(a), bel, 1e-12) << "seed " << kSeed << ", round " << round;
      ASSERT_NEAR(m.pl(a), pl, 1e-12);
      ASSERT_NEAR(m.betp(a), betp, 1e-12);
      ASSERT_NEAR(m.pl(a), 1 - m.bel(m.frame() & ~a), 1e-9);
      ASSERT_LE(m.bel(a), m.betp(a) + 1e-12);
      ASSERT_LE(m.betp(a), m.pl(a) + 1e-12);
      if (std::popcount(a) == 1) singletons += m.betp(a);
      // A probability: additive over disjoint sets.
      const Subset other = static_cast<Subset>(random()) & m.frame() & ~a;
      ASSERT_NEAR(m.betp(a | other), m.betp(a) + m.betp(other), 1e-12);
    }
    ASSERT_NEAR(singletons, 1, 1e-9);
  }
}

TEST(MassFunction, DiscountMovesMassToOmega) {
  Random random(kSeed + 1);
  for (int round = 0; round < 50; ++round) {
    const MassFunction m = random_bba(4, random);
    const double alpha = std::uniform_real_distribution<double>(0, 1)(random);
    const MassFunction weak = m.discounted(alpha);
    for (Subset a = 1; a < m.frame(); ++a) ASSERT_EQ(weak.mass(a), alpha * m.mass(a));
    ASSERT_NEAR(weak.mass(m.frame()), 1 - alpha + alpha * m.mass(m.frame()), 1e-15);
    ASSERT_LE(difference(m.discounted(1), m), 1e-15);
    ASSERT_TRUE(m.discounted(0).is_vacuous());
    ASSERT_LE(difference(m.discounted(alpha).discounted(0.5), m.discounted(alpha * 0.5)), 1e-15);
  }
  EXPECT_TRUE(MassFunction(3).discounted(0.3).is_vacuous());
}

TEST(DempsterRule, GivesThePapersExample) {
  const std::array<MassFunction, 2> in{MassFunction(2, {{kA, .9}, {kA | kB, .1}}),
                                       MassFunction(2, {{kB, .9}, {kA | kB, .1}})};
  const Combined out = dempster_rule(in);
  EXPECT_NEAR(out.mass.mass(kA), .4737, 5e-5);
  EXPECT_NEAR(out.mass.mass(kB), .4737, 5e-5);
  EXPECT_NEAR(out.mass.mass(kA | kB), .0526, 5e-5);
  EXPECT_NEAR(out.conflict, .81, 1e-12);
  EXPECT_FALSE(out.total_conflict);
  EXPECT_NEAR(yager_rule(in).mass.mass(kA), .09, 1e-12);
  EXPECT_NEAR(yager_rule(in).mass.mass(kA | kB), .82, 1e-12);
}

TEST(DempsterRule, GivesZadehsExample) {
  // The counter-intuitive result the paper warns of for |Omega| > 2.
  const std::array<MassFunction, 2> in{MassFunction(3, {{kA, .99}, {kB, .01}}),
                                       MassFunction(3, {{kC, .99}, {kB, .01}})};
  EXPECT_NEAR(dempster_rule(in).mass.mass(kB), 1, 1e-9);
  EXPECT_NEAR(dempster_rule(in).conflict, .9999, 1e-12);
  EXPECT_NEAR(yager_rule(in).mass.mass(kB), 1e-4, 1e-12);
}

TEST(DempsterRule, EqualsAllFocalProducts) {
  Random random(kSeed + 2);
  for (int n = 1; n <= 4; ++n) {
    for (std::size_t count = 1; count <= 3; ++count) {
      for (int round = 0; round < (n == 4 ? 10 : 40); ++round) {
        std::vector<MassFunction> in;
        for (std::size_t i = 0; i < count; ++i) in.push_back(random_bba(n, random));
        const std::vector<long double> want = all_products(in);
        const std::vector<double> met = conjunction(in);
        const Combined dempster = dempster_rule(in), yager = yager_rule(in);
        ASSERT_NEAR(met[0], static_cast<double>(want[0]), 1e-14) << "seed " << kSeed + 2 << ", n " << n;
        ASSERT_NEAR(dempster.conflict, static_cast<double>(want[0]), 1e-13);
        ASSERT_NEAR(yager.conflict, static_cast<double>(want[0]), 1e-13);
        for (Subset a = 1; a <= in[0].frame(); ++a) {
          const bool omega = a == in[0].frame();
          ASSERT_NEAR(met[a], static_cast<double>(want[a]), 1e-14);
          ASSERT_NEAR(dempster.mass.mass(a), static_cast<double>(want[a] / (1 - want[0])), 1e-11);
          ASSERT_NEAR(yager.mass.mass(a), static_cast<double>(want[a] + (omega ? want[0] : 0)), 1e-13);
        }
      }
    }
  }
}

TEST(DempsterRule, IsCommutativeAndAssociativeAndVacuousIsNeutral) {
  Random random(kSeed + 3);
  for (int round = 0; round < 100; ++round) {
    const int n = 2 + static_cast<int>(random() % 4);
    const MassFunction a = random_bba(n, random), b = random_bba(n, random), c = random_bba(n, random);
    const auto fuse = [](const MassFunction& x, const MassFunction& y) {
      return dempster_rule(std::array{x, y}).mass;
    };
    ASSERT_LE(difference(fuse(a, b), fuse(b, a)), 1e-14) << "seed " << kSeed + 3 << ", round " << round;
    ASSERT_LE(difference(fuse(fuse(a, b), c), fuse(a, fuse(b, c))), 1e-11);
    ASSERT_LE(difference(fuse(a, MassFunction(n)), a), 1e-14);
    ASSERT_LE(difference(dempster_rule(std::array{a, b, c}).mass, fuse(fuse(a, b), c)), 1e-14);
    ASSERT_LE(difference(yager_rule(std::array{a, b, c}).mass, yager_rule(std::array{c, a, b}).mass), 1e-14);
    ASSERT_LE(difference(yager_rule(std::array{a, MassFunction(n)}).mass, a), 1e-14);
  }
}

TEST(DempsterRule, TotalConflictBecomesVacuousAndIsSaid) {
  const MassFunction a(2, {{kA, 1}}), b(2, {{kB, 1}}), some(2, {{kA, .5}, {kB, .5}});
  for (const auto& in : {std::vector{a, b}, std::vector{a, some, b}}) {
    const Combined out = dempster_rule(in);
    EXPECT_TRUE(out.total_conflict);
    EXPECT_TRUE(out.mass.is_vacuous());
    EXPECT_EQ(out.conflict, 1);
    EXPECT_TRUE(yager_rule(in).total_conflict);
    EXPECT_TRUE(yager_rule(in).mass.is_vacuous());
  }
}

TEST(DempsterRule, KeepsWhatIsLeftOfAllButTotalConflict) {
  // Products of the least masses: 1e-400 is below the least double.
  const MassFunction a(2, {{kA, 1}, {kA | kB, 1e-200}}), b(2, {{kB, 1}, {kA | kB, 1e-200}});
  const Combined out = dempster_rule(std::array{a, b});
  EXPECT_FALSE(out.total_conflict);
  EXPECT_NEAR(out.mass.mass(kA), .5, 1e-12);
  EXPECT_NEAR(out.mass.mass(kB), .5, 1e-12);
  EXPECT_EQ(out.conflict, 1);
}

TEST(YagerRule, TakesAllInputsAtOnce) {
  const MassFunction a(2, {{kA, .6}, {3, .4}}), b(2, {{kB, .5}, {3, .5}}), c(2, {{kA, .7}, {3, .3}});
  const MassFunction at_once = yager_rule(std::array{a, b, c}).mass;
  const MassFunction folded = yager_rule(std::array{yager_rule(std::array{a, b}).mass, c}).mass;
  EXPECT_GT(difference(at_once, folded), 0.01);
}

TEST(MassFunctionAt, ReadsACell) {
  Layer occupancy(LayerType::occupancy(), 2);
  occupancy.at(0, {1, 3}) = 0.25f;
  occupancy.at(1, {1, 3}) = 0.5f;
  const MassFunction m = mass_function_at(occupancy, LayerType::occupancy(), {1, 3});
  EXPECT_EQ(m, MassFunction(2, {{kA, .25}, {kB, .5}, {3, .25}}));
  EXPECT_TRUE(mass_function_at(occupancy, LayerType::occupancy(), {0, 0}).is_vacuous());

  const LayerType surface = LayerType::semantic("surface", {"Road", "Marking", "Blocked"});
  Layer layer(surface, 0);
  const float thirds[] = {1.0f / 3, 1.0f / 3, 0, 1.0f / 3};
  for (int c = 0; c < 4; ++c) layer.plane(c)[0] = thirds[c];
  const MassFunction road = mass_function_at(layer, surface, {0, 0});
  EXPECT_NEAR(road.mass(kA), 1.0 / 3, 1e-7);
  EXPECT_NEAR(road.mass(7), 1.0 / 3, 1e-7);
  EXPECT_EQ(road.bel(kC), 0);
}

TEST(MassFunctionAt, RefusesWhatHoldsNoMasses) {
  const LayerType height = LayerType::real("height", {"z"});
  expect_code(ErrorCode::kInvalidArgument, [&] { mass_function_at(Layer(height, 0), height, {0, 0}); });
  const LayerType many = LayerType::semantic("many", {"a", "b", "c", "d", "e", "f", "g", "h", "i"});
  expect_code(ErrorCode::kLimit, [&] { mass_function_at(Layer(many, 0), many, {0, 0}); });
  const LayerType occupancy = LayerType::occupancy();
  Layer layer(occupancy, 1);
  expect_code(ErrorCode::kInvalidArgument, [&] { mass_function_at(layer, occupancy, {2, 0}); });
  expect_code(ErrorCode::kInvalidArgument, [&] { mass_function_at(layer, occupancy, {0, -1}); });
  layer.plane(0)[0] = layer.plane(1)[0] = 0.6f;
  expect_code(ErrorCode::kInvalidArgument, [&] { mass_function_at(layer, occupancy, {0, 0}); });
  layer.plane(1)[0] = NAN;
  expect_code(ErrorCode::kInvalidArgument, [&] { mass_function_at(layer, occupancy, {0, 0}); });
}

}  // namespace
}  // namespace apgm

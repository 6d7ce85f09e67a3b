#include "apgm/fuse/combine.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <numeric>

#include "apgm/core/error.hpp"
#include "layers.hpp"

namespace apgm {
namespace {

using test::Random;

CombineReport combine_all(const std::vector<Layer>& layers, const LayerType& type, Rule rule, Layer& out,
                          float* conflict = nullptr) {
  std::vector<const Layer*> inputs;
  for (const Layer& layer : layers) inputs.push_back(&layer);
  return combine(inputs, type, rule, out, conflict);
}

const LayerType kOccupancy = LayerType::occupancy();
const LayerType kSemantic = LayerType::semantic("surface", {"Road", "Marking", "Blocked"});
const LayerType kThree{"three", {"A", "B", "C"}, {"A", "B", "C"}, Policy::kMean, {}};

struct Exact {
  long double o, f, k;
};
Exact exact_dempster(const Layer& a, const Layer& b, std::size_t i) {
  const long double ao = a.plane(0)[i], af = a.plane(1)[i], bo = b.plane(0)[i], bf = b.plane(1)[i];
  const long double au = std::max(0.0L, 1 - ao - af), bu = std::max(0.0L, 1 - bo - bf);
  const long double o = ao * bo + ao * bu + au * bo, f = af * bf + af * bu + au * bf;
  const long double sum = o + f + au * bu;
  if (sum == 0) return {0, 0, 1};
  return {o / sum, f / sum, ao * bf + af * bo};
}

TEST(Combine, GivesThePapersExample) {
  const std::vector<Layer> in{test::occupancy_of(0, {{0.9f, 0.0f}}), test::occupancy_of(0, {{0.0f, 0.9f}})};
  Layer out;
  float k = -1;
  EXPECT_EQ(combine_all(in, kOccupancy, Rule::kDempster, out, &k).total_conflicts, 0u);
  EXPECT_NEAR(out.plane(0)[0], 9.0 / 19.0, 2e-7);
  EXPECT_NEAR(out.plane(1)[0], 9.0 / 19.0, 2e-7);
  EXPECT_NEAR(1 - out.plane(0)[0] - out.plane(1)[0], 0.0526, 1e-4);
  EXPECT_NEAR(k, 0.81, 1e-6);
}

TEST(Combine, StaysWithinErrorBoundAtAnyConflict) {
  Random random(11);
  Layer out;
  std::vector<float> k;
  double worst = 0, worst_k = 0;
  for (int round = 0; round < 40; ++round) {
    const std::vector<Layer> in{test::random_occupancy(6, random), test::random_occupancy(6, random)};
    k.resize(in[0].cells());
    combine_all(in, kOccupancy, Rule::kDempster, out, k.data());
    EXPECT_EQ(test::invalid_cells(out), 0u) << "seed 11, round " << round;
    for (std::size_t i = 0; i < out.cells(); ++i) {
      const Exact want = exact_dempster(in[0], in[1], i);
      worst = std::max(worst, std::fabs(static_cast<double>(out.plane(0)[i] - want.o)));
      worst = std::max(worst, std::fabs(static_cast<double>(out.plane(1)[i] - want.f)));
      const bool both =
          in[0].plane(0)[i] + in[0].plane(1)[i] > 0 && in[1].plane(0)[i] + in[1].plane(1)[i] > 0;
      if (both) worst_k = std::max(worst_k, std::fabs(static_cast<double>(k[i] - want.k)));
      if (!both) {
        EXPECT_EQ(k[i], 0.0f);
      }
    }
  }
  EXPECT_LE(worst, 2e-7);
  EXPECT_LE(worst_k, 2e-7);
}

TEST(Combine, TotalConflictBecomesVacuousAndIsCounted) {
  const Layer occupied = test::occupancy_of(0, {{1.0f, 0.0f}}), free = test::occupancy_of(0, {{0.0f, 1.0f}});
  const Layer more = test::occupancy_of(0, {{0.5f, 0.2f}});
  for (const auto& in : {std::vector<Layer>{occupied, free}, std::vector<Layer>{occupied, more, free}}) {
    Layer out;
    float k = -1;
    EXPECT_EQ(combine_all(in, kOccupancy, Rule::kDempster, out, &k).total_conflicts, 1u);
    EXPECT_TRUE(is_vacuous(out, kOccupancy));
    EXPECT_EQ(k, 1.0f);
  }
  Layer road(kSemantic, 0), blocked(kSemantic, 0), out;
  road.plane(0)[0] = blocked.plane(2)[0] = 1.0f;
  road.plane(3)[0] = blocked.plane(3)[0] = 0.0f;
  EXPECT_EQ(combine_all({road, blocked}, kSemantic, Rule::kDempster, out).total_conflicts, 1u);
  EXPECT_TRUE(is_vacuous(out, kSemantic));
}

TEST(Combine, DempsterOnSingletonsFollowsTheDefinition) {
  Random random(12);
  const Layer a = test::random_semantic(kSemantic, 5, random, 0),
              b = test::random_semantic(kSemantic, 5, random, 0);
  Layer out;
  std::vector<float> conflict(a.cells());
  combine_all({a, b}, kSemantic, Rule::kDempster, out, conflict.data());
  for (std::size_t i = 0; i < a.cells(); ++i) {
    long double m[4], sum = 0, k = 0;
    const long double aw = a.plane(3)[i], bw = b.plane(3)[i];
    for (int c = 0; c < 3; ++c) {
      const long double p = a.plane(c)[i], q = b.plane(c)[i];
      sum += m[c] = p * q + p * bw + aw * q;
      for (int d = 0; d < 3; ++d) k += c == d ? 0 : p * static_cast<long double>(b.plane(d)[i]);
    }
    sum += m[3] = aw * bw;
    for (int c = 0; c < 4; ++c) ASSERT_NEAR(out.plane(c)[i], static_cast<double>(m[c] / sum), 3e-7) << i;
    ASSERT_NEAR(conflict[i], static_cast<double>(k), 3e-7);
  }
}

/// For each kind of type: layers with vacuous cells.
std::vector<Layer> some_layers(const LayerType& type, std::size_t n, Random& random) {
  std::vector<Layer> layers;
  for (std::size_t i = 0; i < n; ++i) {
    if (type.is_occupancy()) {
      layers.push_back(test::random_occupancy(4, random));
    } else if (type.is_evidence()) {
      Layer full = test::random_semantic(kSemantic, 4, random);
      Layer layer(type, 4);
      for (int c = 0; c < layer.channels(); ++c) std::ranges::copy(full.plane(c), layer.plane(c).begin());
      layers.push_back(layer);
    } else {
      layers.push_back(test::random_real(type, 4, random));
    }
  }
  return layers;
}

struct Case {
  LayerType type;
  Rule rule;
};
class CombineRule : public testing::TestWithParam<Case> {};
class OrderlessRule : public CombineRule {};  // all but kLast
class EvidenceRule : public CombineRule {};   // types that hold masses

TEST_P(OrderlessRule, DoesNotDependOnTheOrder) {
  const auto& [type, rule] = GetParam();
  Random random(13);
  for (std::size_t n = 2; n <= 9; ++n) {
    std::vector<Layer> layers = some_layers(type, n, random);
    std::vector<float> k(layers[0].cells()), k_shuffled(k);
    Layer first;
    const auto report = combine_all(layers, type, rule, first, k.data());
    for (int round = 0; round < 6; ++round) {
      std::shuffle(layers.begin(), layers.end(), random);
      Layer out;
      const auto again = combine_all(layers, type, rule, out, k_shuffled.data());
      ASSERT_TRUE(same_cells(first, out)) << "seed 13, n " << n;
      ASSERT_EQ(report.total_conflicts, again.total_conflicts);
      ASSERT_EQ(k, k_shuffled);
    }
  }
}

TEST_P(CombineRule, LoneDataKeepsItsBits) {
  const auto& [type, rule] = GetParam();
  Random random(14);
  for (std::size_t n = 1; n <= 5; ++n) {
    for (std::size_t holder = 0; holder < n; ++holder) {
      std::vector<Layer> layers(n, Layer(type, 4));
      layers[holder] = some_layers(type, 1, random)[0];
      Layer out;
      EXPECT_EQ(combine_all(layers, type, rule, out).total_conflicts, 0u);
      EXPECT_TRUE(same_cells(out, layers[holder])) << "of " << n << ", holder " << holder;
    }
  }
}

TEST_P(CombineRule, VacuousInputChangesNoBit) {
  const auto& [type, rule] = GetParam();
  Random random(15);
  for (std::size_t n = 2; n <= 4; ++n) {
    std::vector<Layer> layers = some_layers(type, n, random);
    Layer without, with;
    combine_all(layers, type, rule, without);
    layers.insert(layers.begin() + 1, Layer(type, 4));
    combine_all(layers, type, rule, with);
    EXPECT_TRUE(same_cells(without, with)) << n;
  }
}

TEST_P(CombineRule, OutputMayBeAnInput) {
  const auto& [type, rule] = GetParam();
  Random random(16);
  for (std::size_t n : {2u, 3u}) {
    for (std::size_t target = 0; target < n; ++target) {
      std::vector<Layer> layers = some_layers(type, n, random);
      Layer out;
      combine_all(layers, type, rule, out);
      combine_all(layers, type, rule, layers[target]);
      EXPECT_TRUE(same_cells(out, layers[target]));
    }
  }
}

TEST_P(CombineRule, RowsAloneGiveTheBitsOfTheWhole) {
  const auto& [type, rule] = GetParam();
  Random random(20);
  for (std::size_t n = 1; n <= 4; ++n) {
    const std::vector<Layer> layers = some_layers(type, n, random);
    std::vector<const Layer*> inputs;
    for (const Layer& layer : layers) inputs.push_back(&layer);
    Layer whole;
    combine(inputs, type, rule, whole);
    for (const RowRange rows : {RowRange{0, 16}, RowRange{3, 4}, RowRange{5, 12}, RowRange{7, 7}}) {
      // Into a layer of its own, and in place into an input.
      for (Layer out : {Layer(type, 4), layers[0]}) {
        const Layer before = out;
        if (same_cells(out, layers[0])) inputs[0] = &out;
        combine_rows(inputs, type, rule, out, rows);
        inputs[0] = &layers[0];
        for (int c = 0; c < out.channels(); ++c) {
          for (int b = 0; b < 16; ++b) {
            const Layer& want = b >= rows.begin && b < rows.end ? whole : before;
            ASSERT_EQ(std::memcmp(&out.plane(c)[b * 16], &want.plane(c)[b * 16], 64), 0)
                << n << ", row " << b;
          }
        }
      }
    }
  }
}

TEST_P(EvidenceRule, KeepsMassesValid) {
  const auto& [type, rule] = GetParam();
  Random random(17);
  for (std::size_t n = 2; n <= 6; ++n) {
    for (int round = 0; round < 20; ++round) {
      Layer out;
      combine_all(some_layers(type, n, random), type, rule, out);
      ASSERT_NO_THROW(canonicalise(out, type)) << "seed 17, n " << n;
      if (type.is_occupancy()) {
        ASSERT_EQ(test::invalid_cells(out), 0u);
      }
    }
  }
}

std::vector<Case> all_cases() {
  std::vector<Case> cases;
  for (const LayerType& type : {kOccupancy, kSemantic, kThree, LayerType::real("velocity", {"x", "y"}),
                                LayerType::real("points", {"n"}, Policy::kSum)}) {
    for (Rule rule : {Rule::kDempster, Rule::kYager, Rule::kMean, Rule::kMax, Rule::kLast}) {
      cases.push_back({type, rule});
    }
  }
  return cases;
}
template <typename Fits>
std::vector<Case> cases_that(Fits fits) {
  std::vector<Case> cases = all_cases();
  std::erase_if(cases, [&](const Case& c) { return !fits(c); });
  return cases;
}
std::string name_of(const testing::TestParamInfo<Case>& test) {
  return test.param.type.name + "_" + std::string(to_string(test.param.rule));
}
INSTANTIATE_TEST_SUITE_P(All, CombineRule, testing::ValuesIn(all_cases()), name_of);
INSTANTIATE_TEST_SUITE_P(All, OrderlessRule,
                         testing::ValuesIn(cases_that([](const Case& c) { return c.rule != Rule::kLast; })),
                         name_of);
INSTANTIATE_TEST_SUITE_P(All, EvidenceRule,
                         testing::ValuesIn(cases_that([](const Case& c) { return c.type.is_evidence(); })),
                         name_of);

TEST(Combine, RulesGiveTheirDefinitions) {
  const std::vector<Layer> in{test::occupancy_of(0, {{0.6f, 0.1f}}), test::occupancy_of(0, {{0.2f, 0.5f}}),
                              test::occupancy_of(0, {{0.0f, 0.0f}})};
  Layer out;
  combine_all(in, kOccupancy, Rule::kYager, out);  // K = .6 * .5 + .1 * .2 = .32
  EXPECT_NEAR(out.plane(0)[0], 0.6 * 0.2 + 0.6 * 0.3 + 0.3 * 0.2, 1e-7);
  EXPECT_NEAR(out.plane(1)[0], 0.1 * 0.5 + 0.1 * 0.3 + 0.3 * 0.5, 1e-7);
  combine_all(in, kOccupancy, Rule::kMean, out);
  EXPECT_NEAR(out.plane(0)[0], 0.4, 1e-7);
  EXPECT_NEAR(out.plane(1)[0], 0.3, 1e-7);
  combine_all(in, kOccupancy, Rule::kMax, out);
  EXPECT_TRUE(same_cells(out, in[0]));
  combine_all(in, kOccupancy, Rule::kLast, out);
  EXPECT_TRUE(same_cells(out, in[1]));
}

TEST(Combine, ManyInputsAgreeWithTheDefinition) {
  Random random(18);
  const std::vector<Layer> in = some_layers(kOccupancy, 5, random);
  Layer out;
  combine_all(in, kOccupancy, Rule::kDempster, out);
  for (std::size_t i = 0; i < out.cells(); ++i) {
    long double o = 0, f = 0, u = 1;
    for (const Layer& layer : in) {
      const long double bo = layer.plane(0)[i], bf = layer.plane(1)[i], bu = std::max(0.0L, 1 - bo - bf);
      const long double no = o * bo + o * bu + u * bo, nf = f * bf + f * bu + u * bf;
      u *= bu;
      o = no;
      f = nf;
    }
    const long double sum = o + f + u;
    if (sum < 1e-20L) continue;  // all but total conflict: the order of the folds decides the last digits
    ASSERT_NEAR(out.plane(0)[i], static_cast<double>(o / sum), 1e-6) << i;
    ASSERT_NEAR(out.plane(1)[i], static_cast<double>(f / sum), 1e-6) << i;
  }
}

TEST(Combine, TakesTheNewestStampAndRefusesOtherShapes) {
  Layer a(kOccupancy, 2), b(kOccupancy, 2), c(kOccupancy, 3), out;
  a.stamp_ns = 5;
  b.stamp_ns = 9;
  combine_all({a, b}, kOccupancy, Rule::kDempster, out);
  EXPECT_EQ(out.stamp_ns, 9);
  EXPECT_THROW(combine_all({a, c}, kOccupancy, Rule::kDempster, out), Error);
}

TEST(CombineRows, CountsTheirConflictsAndKeepsTheNewestStamp) {
  Layer a(kOccupancy, 2), b(kOccupancy, 2);
  for (const std::size_t i : {0u, 5u, 6u}) a.plane(0)[i] = b.plane(1)[i] = 1.0f;
  a.stamp_ns = 9;
  b.stamp_ns = 5;
  Layer out(kOccupancy, 2);
  out.stamp_ns = 12;
  const std::array<const Layer*, 2> in{&a, &b};
  EXPECT_EQ(combine_rows(in, kOccupancy, Rule::kDempster, out, {1, 2}).total_conflicts, 2u);
  EXPECT_EQ(out.stamp_ns, 12);
  EXPECT_EQ(combine_rows(in, kOccupancy, Rule::kDempster, a, {0, 1}).total_conflicts, 1u);
  EXPECT_EQ(a.stamp_ns, 9);
}

TEST(CombineRows, RefusesOtherShapesAndRowsOutside) {
  const Layer a(kOccupancy, 2);
  const std::array<const Layer*, 1> in{&a};
  Layer out(kOccupancy, 3), right(kOccupancy, 2);
  EXPECT_THROW(combine_rows(in, kOccupancy, Rule::kDempster, out, {0, 1}), Error);
  EXPECT_THROW(combine_rows(in, kOccupancy, Rule::kDempster, right, {-1, 1}), Error);
  EXPECT_THROW(combine_rows(in, kOccupancy, Rule::kDempster, right, {0, 5}), Error);
  EXPECT_NO_THROW(combine_rows(in, kOccupancy, Rule::kDempster, right, {0, 4}));
}

TEST(Rule, NamesGoBothWays) {
  for (Rule rule : {Rule::kDempster, Rule::kYager, Rule::kMean, Rule::kMax, Rule::kLast}) {
    EXPECT_EQ(rule_from(to_string(rule)), rule);
  }
  EXPECT_FALSE(rule_from("bayes"));
}

TEST(Discount, MovesMassToOmega) {
  Layer layer = test::occupancy_of(0, {{0.6f, 0.2f}});
  discount(layer, kOccupancy, 0.5f);
  EXPECT_EQ(layer.plane(0)[0], 0.3f);
  EXPECT_EQ(layer.plane(1)[0], 0.1f);
  Random random(19);
  Layer semantic = test::random_semantic(kSemantic, 4, random);
  const Layer before = semantic;
  discount(semantic, kSemantic, 1.0f);
  EXPECT_TRUE(same_cells(before, semantic));
  discount(semantic, kSemantic, 0.3f);
  for (std::size_t i = 0; i < semantic.cells(); ++i) {
    EXPECT_NEAR(semantic.plane(3)[i], 0.7 + 0.3 * static_cast<double>(before.plane(3)[i]), 2e-7);
    if (before.plane(3)[i] == 1.0f) {
      EXPECT_EQ(semantic.plane(3)[i], 1.0f);
    }
  }
  discount(semantic, kSemantic, 0.0f);
  EXPECT_TRUE(is_vacuous(semantic, kSemantic));
  EXPECT_THROW(discount(semantic, kSemantic, 1.5f), Error);
  EXPECT_THROW(discount(semantic, kSemantic, NAN), Error);
}

}  // namespace
}  // namespace apgm

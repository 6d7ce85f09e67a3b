// The float32 paths over whole layers beside the general evidence theory of core/mass_function.hpp.
#include <gtest/gtest.h>

#include <algorithm>

#include "apgm/core/mass_function.hpp"
#include "apgm/fuse/combine.hpp"
#include "apgm/fuse/resample.hpp"
#include "layers.hpp"

namespace apgm {
namespace {

using test::Random;
constexpr unsigned kSeed = 91;

/// Occupancy; singletons and m(Omega) with 2 to 5 classes; the same with m(Omega) implicit.
std::vector<LayerType> frames() {
  std::vector<LayerType> types{LayerType::occupancy()};
  const std::vector<std::string> names{"a", "b", "c", "d", "e"};
  for (std::size_t n = 2; n <= 5; ++n) {
    const std::vector<std::string> classes(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(n));
    types.push_back(LayerType::semantic("explicit" + std::to_string(n), classes));
    if (n > 2) types.push_back({"implicit" + std::to_string(n), classes, classes, Policy::kMean, {}});
  }
  return types;
}

/// From nearly certain cells (high conflict) to nearly vacuous ones.
Layer random_masses(const LayerType& type, int step, Random& random) {
  if (type.is_occupancy()) return test::random_occupancy(step, random, 0.1f);
  Layer layer(type, step);
  const std::size_t n = type.hypotheses.size();
  for (std::size_t i = 0; i < layer.cells(); ++i) {
    if (random() % 8 == 0) continue;
    std::vector<double> m(n + 1);
    double sum = 0;
    for (double& v : m) sum += v = std::pow(10.0, -6.0 * static_cast<double>(test::uniform(random)));
    for (int c = 0; c < layer.channels(); ++c) {
      layer.plane(c)[i] = static_cast<float>(m[static_cast<std::size_t>(c)] / sum);
    }
  }
  return layer;
}

struct Worst {
  double mass = 0;
  double conflict = 0;
};

/// Greatest differences between combine() and the rule on mass functions, over cells that the first two or
/// more inputs hold.
Worst compare(const std::vector<Layer>& layers, const LayerType& type, Rule rule) {
  std::vector<const Layer*> inputs;
  for (const Layer& layer : layers) inputs.push_back(&layer);
  Layer out;
  std::vector<float> k(layers[0].cells());
  const std::uint64_t counted = combine(inputs, type, rule, out, k.data()).total_conflicts;
  Worst worst;
  std::uint64_t total = 0;
  for (int b = 0; b < out.side(); ++b) {
    for (int a = 0; a < out.side(); ++a) {
      std::vector<MassFunction> cells;
      for (const Layer& layer : layers) {
        cells.push_back(mass_function_at(layer, type, {a, b}));
        if (cells.back().is_vacuous()) cells.pop_back();
      }
      if (cells.empty()) cells.emplace_back(static_cast<int>(type.hypotheses.size()));
      const Combined want = rule == Rule::kDempster ? dempster_rule(cells) : yager_rule(cells);
      total += rule == Rule::kDempster && want.total_conflict;
      for (int c = 0; c < out.channels(); ++c) {
        const bool omega = c == static_cast<int>(type.hypotheses.size());
        const double m = want.mass.mass(omega ? want.mass.frame() : Subset{1} << c);
        worst.mass = std::max(worst.mass, std::abs(m - static_cast<double>(out.at(c, {a, b}))));
      }
      const float met = k[static_cast<std::size_t>(b * out.side() + a)];
      worst.conflict = std::max(worst.conflict, std::abs(want.conflict - static_cast<double>(met)));
    }
  }
  EXPECT_EQ(counted, total) << type.name;
  return worst;
}

TEST(FastPaths, AgreeWithEvidenceTheory) {
  Random random(kSeed);
  for (const LayerType& type : frames()) {
    for (const Rule rule : {Rule::kDempster, Rule::kYager}) {
      Worst worst;
      for (int round = 0; round < 12; ++round) {
        const std::vector<Layer> in{random_masses(type, 4, random), random_masses(type, 4, random)};
        const Worst w = compare(in, type, rule);
        worst = {std::max(worst.mass, w.mass), std::max(worst.conflict, w.conflict)};
      }
      EXPECT_LE(worst.mass, 2.5e-7) << type.name << ' ' << to_string(rule) << ", seed " << kSeed;
      EXPECT_LE(worst.conflict, 2.5e-7) << type.name << ' ' << to_string(rule);
    }
  }
}

TEST(FastPaths, AgreeForManyInputs) {
  Random random(kSeed + 1);
  for (const LayerType& type : frames()) {
    for (std::size_t n = 3; n <= 5; ++n) {
      std::vector<Layer> in;
      for (std::size_t i = 0; i < n; ++i) in.push_back(random_masses(type, 4, random));
      for (const Rule rule : {Rule::kDempster, Rule::kYager}) {
        const Worst worst = compare(in, type, rule);
        EXPECT_LE(worst.mass, 4e-7) << type.name << ' ' << to_string(rule) << ", n " << n << ", seed "
                                    << kSeed + 1;
        EXPECT_LE(worst.conflict, 4e-7) << type.name << ' ' << to_string(rule) << ", n " << n;
      }
    }
  }
}

TEST(FastPaths, SmallMassesSurviveUntilALaterConflictMakesThemGreat) {
  // A bound on the sum between the folds once cut m(c) of the first two: an error of 0.17.
  const LayerType type{"three", {"a", "b", "c"}, {"a", "b", "c"}, Policy::kMean, {}};
  std::vector<Layer> in(3, Layer(type, 0));
  const float masses[3][3] = {{1e-7f, .999999f, 2e-7f}, {2e-7f, .999999f, 3e-7f}, {.5f, 0, .5f}};
  for (std::size_t i = 0; i < 3; ++i) {
    for (int c = 0; c < 3; ++c) in[i].plane(c)[0] = masses[i][c];
  }
  EXPECT_LE(compare(in, type, Rule::kDempster).mass, 2e-7);
}

TEST(FastPaths, DempsterPolicyAgrees) {
  const LayerType type = LayerType::occupancy("occupancy", Policy::kDempster);
  Random random(kSeed + 3);
  for (int round = 0; round < 100; ++round) {
    const Layer in = test::random_occupancy(2, random);
    Layer out;
    resample(in, type, 0, out);
    std::vector<MassFunction> cells;
    for (int i = 0; i < 16; ++i) cells.push_back(mass_function_at(in, type, {i % 4, i / 4}));
    const Combined want = dempster_rule(cells);
    // All but total conflict: what is left is below float32.
    if (want.total_conflict || 1 - want.conflict < 1e-12) continue;
    ASSERT_NEAR(out.plane(0)[0], want.mass.mass(1), 1e-6) << "seed " << kSeed + 3 << ", round " << round;
    ASSERT_NEAR(out.plane(1)[0], want.mass.mass(2), 1e-6);
  }
}

TEST(FastPaths, DiscountAgrees) {
  Random random(kSeed + 2);
  for (const LayerType& type : frames()) {
    const Layer before = random_masses(type, 4, random);
    for (const float alpha : {0.0f, 0.1f, 0.7f, 1.0f}) {
      Layer layer = before;
      discount(layer, type, alpha);
      for (int i = 0; i < 256; ++i) {
        const CellIndex cell{i % 16, i / 16};
        const MassFunction want = mass_function_at(before, type, cell).discounted(static_cast<double>(alpha));
        const MassFunction got = mass_function_at(layer, type, cell);
        for (Subset a = 1; a <= want.frame(); ++a)
          ASSERT_NEAR(want.mass(a), got.mass(a), 1.5e-7) << type.name;
      }
    }
  }
}

}  // namespace
}  // namespace apgm

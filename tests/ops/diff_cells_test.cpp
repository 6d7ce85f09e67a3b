#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>

#include "apgm/core/mass_function.hpp"
#include "diffs.hpp"

namespace apgm {
namespace {

using test::compare;
using test::one_layer;

TEST(DiffCells, CountsKindsOfAHandMadeMap) {
  const LayerType type = LayerType::occupancy();
  const Map a = one_layer(type, 1, {{0.75f, 0.0f, 0.25f, 0.0f}, {0.0f, 0.5f, 0.5f, 0.0f}});
  const Map b = one_layer(type, 1, {{0.25f, 0.5f, 0.0f, 0.5f}, {0.5f, 0.25f, 0.0f, 0.0f}});
  const DiffReport report = compare(a, b);
  EXPECT_TRUE(report.different);
  EXPECT_EQ(report.patches_changed, 1u);
  ASSERT_EQ(report.types.size(), 1u);
  const TypeDiff& d = report.types[0];
  const double cell_m2 = 6.4 * 6.4;
  EXPECT_EQ(d.layers_changed, 1u);
  EXPECT_EQ(d.compared, (CellTally{4, 4 * cell_m2}));
  EXPECT_EQ(d.changed.cells, 4u);
  EXPECT_EQ(d.occupied_to_free.cells, 1u);
  EXPECT_EQ(d.free_to_occupied.cells, 1u);
  EXPECT_EQ(d.forgotten.cells, 1u);
  EXPECT_EQ(d.learned, (CellTally{1, cell_m2}));
  EXPECT_EQ(d.adjusted.cells, 0u);
  // BetP(O) .875, .25, .375, .5 and .375, .625, .5, .75.
  EXPECT_DOUBLE_EQ(d.betp_delta.max, 0.5);
  EXPECT_DOUBLE_EQ(d.betp_delta.mean, (0.5 + 0.375 + 0.125 + 0.25) / 4);
  EXPECT_DOUBLE_EQ(d.max_mass_delta, 0.5);
  EXPECT_DOUBLE_EQ(d.conflict.max, 0.375);
  EXPECT_DOUBLE_EQ(d.conflict.mean, (0.375 + 0.25) / 4);
  EXPECT_DOUBLE_EQ(d.jousselme.max, 0.5);
}

TEST(DiffCells, KlDivergenceIsThatOfCompareOctrees) {
  // compare_octrees sums log(p1 / p2) p1 + log((1 - p1) / (1 - p2)) (1 - p1) over the leaves.
  test::Random random(31);
  std::vector<float> o(64), f(64), o2(64), f2(64);
  double expected = 0;
  const auto draw = [&](float& occupied, float& free) {
    const auto p = static_cast<float>(random.in(12, 97)) / 100.0f;  // OctoMap clamps to about this
    (p >= 0.5f ? occupied : free) = p >= 0.5f ? 2 * p - 1 : 1 - 2 * p;
    return 0.5 * (1 + static_cast<double>(occupied) - static_cast<double>(free));
  };
  for (std::size_t i = 0; i < o.size(); ++i) {
    const double p1 = draw(o[i], f[i]), p2 = draw(o2[i], f2[i]);
    expected += std::log(p1 / p2) * p1 + std::log((1 - p1) / (1 - p2)) * (1 - p1);
  }
  const DiffReport report =
      compare(one_layer(LayerType::occupancy(), 3, {o, f}), one_layer(LayerType::occupancy(), 3, {o2, f2}));
  EXPECT_NEAR(report.types[0].kl_divergence, expected, 1e-11 * expected);
}

TEST(DiffCells, KlDivergenceOfCertainCellsStaysFinite) {
  const Map a = one_layer(LayerType::occupancy(), 0, {{1.0f}, {0.0f}});
  const Map b = one_layer(LayerType::occupancy(), 0, {{0.0f}, {1.0f}});
  EXPECT_NEAR(compare(a, b).types[0].kl_divergence, std::log(1e6), 1e-4);
}

/// Jousselme's distance by its definition over the power set.
double jousselme_of(const MassFunction& p, const MassFunction& q) {
  const auto n = static_cast<Subset>(p.masses().size());
  double sum = 0;
  for (Subset a = 1; a < n; ++a) {
    for (Subset b = 1; b < n; ++b) {
      const double common = std::popcount(a & b), all = std::popcount(a | b);
      sum += (p.mass(a) - q.mass(a)) * (p.mass(b) - q.mass(b)) * common / all;
    }
  }
  return std::sqrt(sum / 2);
}

TEST(DiffCells, BeliefFiguresFollowTheDefinitions) {
  const LayerType type = LayerType::semantic("s", {"a", "b", "c"});
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    test::Random random(seed);
    MapHeader header;
    header.types = TypeTable({type});
    Map maps[] = {Map(header), Map(header)};
    for (Map& map : maps) {
      Layer& layer = map.layer({0, 0}, 0, 3);
      while (is_vacuous(layer, type)) test::detail::fill_layer(type, random, layer);
    }
    const TypeDiff d = compare(maps[0], maps[1]).types.at(0);
    const Layer &a = *maps[0].find({0, 0}, 0), &b = *maps[1].find({0, 0}, 0);
    double betp = 0, jousselme = 0, conflict = 0, kl = 0, most_mass = 0;
    std::uint64_t compared = 0, changed = 0;
    for (std::int32_t i = 0; i < 64; ++i) {
      const CellIndex cell{i % 8, i / 8};
      const MassFunction p = mass_function_at(a, type, cell), q = mass_function_at(b, type, cell);
      if (p.is_vacuous() && q.is_vacuous()) continue;
      ++compared;
      changed += !(p == q);
      const MassFunction both[] = {p, q};
      conflict += dempster_rule(both).conflict;
      double most = 0;
      for (Subset h = 1; h <= 4; h *= 2) {
        most = std::max(most, std::fabs(p.betp(h) - q.betp(h)));
        const double x = std::max(1e-6, p.betp(h)), y = std::max(1e-6, q.betp(h));
        kl += x * std::log(x / y);
      }
      betp += most;
      jousselme += jousselme_of(p, q);
      for (int c = 0; c < 4; ++c) {
        most_mass = std::max(most_mass, std::fabs(static_cast<double>(a.at(c, cell) - b.at(c, cell))));
      }
    }
    EXPECT_EQ(d.compared.cells, compared);
    EXPECT_EQ(d.changed.cells, changed);
    const auto n = static_cast<double>(compared);
    EXPECT_NEAR(d.betp_delta.mean, betp / n, 1e-12);
    EXPECT_NEAR(d.jousselme.mean, jousselme / n, 1e-12);
    EXPECT_NEAR(d.conflict.mean, conflict / n, 1e-7);
    EXPECT_NEAR(d.kl_divergence, kl, 1e-3);  // without the clamped values brought back to the sum 1
    EXPECT_DOUBLE_EQ(d.max_mass_delta, most_mass);
  }
}

TEST(DiffCells, ClassesAndNumbers) {
  const LayerType semantic = LayerType::semantic("s", {"a", "b"});
  const Map a = one_layer(semantic, 1, {{0.5f, 0.5f, 0.5f, 0}, {0, 0, 0.25f, 0}, {0.5f, 0.5f, 0.25f, 1}});
  const Map b = one_layer(semantic, 1, {{0, 0.25f, 0.25f, 0}, {0.5f, 0, 0.25f, 0}, {0.5f, 0.75f, 0.5f, 1}});
  const TypeDiff d = compare(a, b).types.at(0);
  EXPECT_EQ(d.class_changed.cells, 1u);
  EXPECT_EQ(d.adjusted.cells, 2u);  // less sure, and undecided
  EXPECT_EQ(d.compared.cells, 3u);
  EXPECT_EQ(d.free_to_occupied.cells + d.occupied_to_free.cells, 0u);

  const float none = std::numeric_limits<float>::quiet_NaN();
  const LayerType height = LayerType::real("z", {"z", "v"});
  const Map low = one_layer(height, 1, {{1, 2, none, none}, {0, 0, 5, none}});
  const Map high = one_layer(height, 1, {{1, 4, 1, none}, {0, 1, 5, 7}});
  const TypeDiff z = compare(low, high).types.at(0);
  EXPECT_EQ(z.compared.cells, 4u);
  EXPECT_EQ(z.changed.cells, 3u);
  EXPECT_EQ(z.learned.cells, 1u);
  EXPECT_EQ(z.adjusted.cells, 2u);
  ASSERT_EQ(z.channels.size(), 2u);
  EXPECT_EQ(z.channels[0], (TypeDiff::Channel{2, {1, 2}}));  // no number in the third cell
  EXPECT_EQ(z.channels[1].cells, 3u);
  EXPECT_EQ(z.channels[1].delta.max, 1);
  EXPECT_EQ(z.betp_delta, Spread{});
}

}  // namespace
}  // namespace apgm

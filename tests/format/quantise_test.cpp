#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <random>

#include "codec.hpp"

namespace apgm::format {
namespace {

/// Largest remainders of two masses and the rest, as docs/design/0004 says it: floors, then one more for the
/// largest remainder until the sum fits; of equal ones the first.
std::array<float, 2> by_the_page(float first, float second, std::uint32_t levels) {
  const double omega = std::max(0.0, 1.0 - static_cast<double>(first) - static_cast<double>(second));
  const std::array<double, 3> exact{static_cast<double>(first) * levels, static_cast<double>(second) * levels,
                                    omega * levels};
  std::array<std::uint32_t, 3> whole{};
  std::array<std::size_t, 3> order{0, 1, 2};
  for (std::size_t i = 0; i < 3; ++i) whole[i] = static_cast<std::uint32_t>(exact[i]);
  std::ranges::stable_sort(
      order, [&](std::size_t a, std::size_t b) { return exact[a] - whole[a] > exact[b] - whole[b]; });
  const std::uint32_t sum = whole[0] + whole[1] + whole[2];
  for (std::uint32_t i = 0; sum + i < levels; ++i) ++whole[order[i]];
  for (std::uint32_t over = sum; over > levels; --over) --*std::ranges::max_element(whole);
  return {static_cast<float>(whole[0]) / static_cast<float>(levels),
          static_cast<float>(whole[1]) / static_cast<float>(levels)};
}

class Quantise : public testing::TestWithParam<Lossy> {
 protected:
  std::uint32_t levels() const { return GetParam() == Lossy::kU8 ? 255 : 65535; }

  void expect_by_the_page(const std::vector<std::array<float, 2>>& cells) const {
    const LayerType type = LayerType::occupancy();
    Layer layer(type, 7);
    ASSERT_LE(cells.size(), layer.cells());
    for (std::size_t i = 0; i < cells.size(); ++i) {
      for (int c = 0; c < 2; ++c) layer.plane(c)[i] = cells[i][static_cast<std::size_t>(c)];
    }
    quantise(layer, type, GetParam());
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const auto wanted = by_the_page(cells[i][0], cells[i][1], levels());
      ASSERT_EQ(layer.plane(0)[i], wanted[0]) << cells[i][0] << " " << cells[i][1];
      ASSERT_EQ(layer.plane(1)[i], wanted[1]) << cells[i][0] << " " << cells[i][1];
    }
  }
};

TEST_P(Quantise, GivesTheLargestRemaindersOneMore) {
  std::mt19937_64 rng(7);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<std::array<float, 2>> cells;
  while (cells.size() < 16'000) {
    const float first = unit(rng), second = unit(rng) * (1 - first);
    if (rng() % 4 != 0) cells.push_back({first, rng() % 2 == 0 ? second : 0});
  }
  expect_by_the_page(cells);
}

TEST_P(Quantise, BreaksTiesByTheOrderOfTheChannels) {
  std::vector<std::array<float, 2>> cells;
  for (float eighths = 0; eighths <= 8; ++eighths) {
    for (float other = 0; other + eighths <= 8; ++other) cells.push_back({eighths / 8, other / 8});
  }
  const float third = 1.0f / 3;
  cells.insert(cells.end(), {{third, third}, {0.5f, 0.25f}, {0.25f, 0.5f}, {0.25f, 0.25f}});
  expect_by_the_page(cells);
}

TEST_P(Quantise, TakesMassesThatSumToSlightlyMoreThanOne) {
  expect_by_the_page({{0.50000006f, 0.5f}, {0.5f, 0.50000006f}, {1, 0}, {0, 1}, {0.99999994f, 1e-7f}});
}

TEST_P(Quantise, ChangesNothingTheSecondTime) {
  std::mt19937_64 rng(8);
  const LayerType type = LayerType::occupancy();
  Layer layer(type, 6);
  for (std::size_t i = 0; i < layer.cells(); ++i) {
    layer.plane(0)[i] = static_cast<float>(static_cast<int>(rng() % 1000)) / 2000;
    layer.plane(1)[i] = static_cast<float>(static_cast<int>(rng() % 1000)) / 2000;
  }
  quantise(layer, type, GetParam());
  Layer again = layer;
  quantise(again, type, GetParam());
  EXPECT_TRUE(std::ranges::equal(again.plane(0), layer.plane(0)));
  EXPECT_TRUE(std::ranges::equal(again.plane(1), layer.plane(1)));
}

INSTANTIATE_TEST_SUITE_P(Levels, Quantise, testing::Values(Lossy::kU8, Lossy::kU16));

}  // namespace
}  // namespace apgm::format

#include "apgm/fuse/regrid.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "apgm/core/error.hpp"
#include "apgm/core/map.hpp"
#include "apgm/fuse/resample.hpp"
#include "layers.hpp"

namespace apgm {
namespace {

using test::Random;

Frame frame_of(std::int64_t x_um, std::int64_t y_um, std::int64_t edge_um) {
  Frame frame;
  frame.datum_x_um = x_um;
  frame.datum_y_um = y_um;
  frame.edge_um = edge_um;
  return frame;
}

Map map_of(const LayerType& type, const Frame& frame) {
  MapHeader header;
  header.frame = frame;
  header.types = TypeTable({type});
  return Map(header);
}

Map random_map(const LayerType& type, const Frame& frame, int step, Random& random) {
  Map map = map_of(type, frame);
  for (const PatchIndex index : {PatchIndex{0, 0}, PatchIndex{1, 0}, PatchIndex{-1, 2}}) {
    Layer& layer = map.layer(index, 0, step);
    if (type.is_occupancy()) {
      layer = type.policy == Policy::kExclusive ? test::random_exclusive(step, random)
                                                : test::random_occupancy(step, random);
    } else if (type.is_evidence()) {
      layer = test::random_semantic(type, step, random);
    } else {
      layer = test::random_real(type, step, random);
    }
  }
  return map;
}

/// The source in memory, without vacuous layers.
Map read(const PatchSource& source) {
  Map map(source.header());
  const auto cursor = source.patches();
  PatchInfo info;
  std::uint64_t last = 0;
  bool first = true;
  while (cursor->next(info)) {
    const std::uint64_t key = curve_key(info.patch);
    EXPECT_TRUE(first || key > last);
    first = false;
    last = key;
    for (const LayerInfo& layer : info.layers) {
      Layer& cells = map.layer(info.patch, layer.type, layer.step);
      source.load(layer, cells);
      EXPECT_EQ(cells.step(), layer.step);
      EXPECT_NO_THROW(canonicalise(cells, map.header().types[layer.type]));
    }
  }
  map.prune();
  return map;
}

void expect_same(const Map& a, const Map& b, float tolerance) {
  ASSERT_EQ(a.size(), b.size());
  for (const auto& [key, patch] : a.by_key()) {
    const Layer* other = b.find(patch.index, 0);
    ASSERT_NE(other, nullptr);
    ASSERT_EQ(patch.layers.at(0).step(), other->step());
    if (tolerance == 0) {
      EXPECT_TRUE(same_cells(patch.layers.at(0), *other));
    } else {
      EXPECT_LE(test::difference(patch.layers.at(0), *other), tolerance);
    }
  }
}

long double total_lambda(const Map& map) {
  long double sum = 0;
  for (const auto& [key, patch] : map.by_key()) sum += test::sum_lambda(patch.layers.at(0));
  return sum;
}

std::vector<LayerType> all_types() {
  std::vector<LayerType> types;
  for (const Policy p : {Policy::kExclusive, Policy::kConditional, Policy::kMin, Policy::kProduct,
                         Policy::kMedian, Policy::kDempster, Policy::kMean}) {
    types.push_back(LayerType::occupancy(std::string(to_string(p)), p));
  }
  types.push_back(LayerType::semantic("surface", {"Road", "Marking"}));
  types.push_back(LayerType::semantic("classes", {"Road", "Marking"}, Policy::kMean));
  types.push_back(LayerType::real("velocity", {"x", "y"}));
  types.push_back(LayerType::real("points", {"n"}, Policy::kSum));
  types.push_back(LayerType::real("low", {"z"}, Policy::kMinimum));
  types.push_back(LayerType::real("high", {"z"}, Policy::kMaximum));
  return types;
}

class RegridType : public testing::TestWithParam<LayerType> {};
/// Policies that do to areas what they do to powers of two; kMedian and kDempster are taken as kConditional.
class RegridAreaType : public RegridType {};

TEST_P(RegridType, SameFrameIsTheIdentityBitByBit) {
  Random random(71);
  const Frame frame = frame_of(123'456, -7'000'001, 12'800'000);
  const Map map = random_map(GetParam(), frame, 4, random);
  expect_same(map, read(*regrid(map, frame)), 0);
}

TEST_P(RegridType, WholeCellsApartMovesBits) {
  Random random(72);
  const Map map = random_map(GetParam(), frame_of(0, 0, 12'800'000), 4, random);
  // Three cells of 0.8 m and one patch; back again gives the map.
  const Frame moved = frame_of(-12'800'000 - 3 * 800'000, 5 * 800'000, 12'800'000);
  const Map there = read(*regrid(map, moved));
  EXPECT_GT(there.size(), map.size());
  expect_same(map, read(*regrid(there, map.header().frame)), 0);
  // The same by a shift that is undone.
  const Map shifted = read(*regrid(map, map.header().frame, {.shift_m = {2.4, -0.8}}));
  expect_same(map, read(*regrid(shifted, map.header().frame, {.shift_m = {-2.4, 0.8}})), 0);
}

TEST_P(RegridType, PatchEdgeAloneMovesBits) {
  Random random(73);
  const Map map = random_map(GetParam(), frame_of(0, 0, 12'800'000), 4, random);
  const Map small = read(*regrid(map, frame_of(0, 0, 3'200'000)));
  EXPECT_EQ(small.by_key().begin()->second.layers.at(0).step(), 2);
  expect_same(map, read(*regrid(small, map.header().frame)), 0);
}

TEST_P(RegridAreaType, RefinementAgreesWithResample) {
  Random random(74);
  const Map map = random_map(GetParam(), frame_of(0, 0, 12'800'000), 4, random);
  const Map fine = read(*regrid(map, map.header().frame, {}, 6));
  for (const auto& [key, patch] : map.by_key()) {
    Layer want;
    resample(patch.layers.at(0), GetParam(), 6, want);
    ASSERT_NE(fine.find(patch.index, 0), nullptr);
    EXPECT_LE(test::difference(want, *fine.find(patch.index, 0)), 2e-6f);
  }
}

TEST_P(RegridAreaType, CoarseningAgreesWithResample) {
  Random random(75);
  const Map map = random_map(GetParam(), frame_of(0, 0, 12'800'000), 4, random);
  const Map coarse = read(*regrid(map, map.header().frame, {}, 2));
  for (const auto& [key, patch] : map.by_key()) {
    Layer want;
    resample(patch.layers.at(0), GetParam(), 2, want);
    ASSERT_NE(coarse.find(patch.index, 0), nullptr);
    EXPECT_LE(test::difference(want, *coarse.find(patch.index, 0)), 5e-6f);
  }
}

TEST_P(RegridType, QuarterTurnPermutesCells) {
  Random random(76);
  const Frame frame = frame_of(0, 0, 12'800'000);
  const Map map = random_map(GetParam(), frame, 4, random);
  const Map turned = read(*regrid(map, frame, {.yaw_rad = std::numbers::pi / 2}));
  ASSERT_EQ(turned.size(), map.size());
  // (x, y) -> (-y, x): cell (a, b) of patch (ix, iy) becomes cell (m - 1 - b, a) of patch (-1 - iy, ix).
  for (const auto& [key, patch] : map.by_key()) {
    const Layer& in = patch.layers.at(0);
    const Layer* out = turned.find({-1 - patch.index.y, patch.index.x}, 0);
    ASSERT_NE(out, nullptr);
    Layer want(GetParam(), 4);
    for (int c = 0; c < in.channels(); ++c) {
      for (int b = 0; b < 16; ++b) {
        for (int a = 0; a < 16; ++a) want.at(c, {15 - b, a}) = in.at(c, {a, b});
      }
    }
    EXPECT_LE(test::difference(want, *out), 1e-6f);
  }
}

TEST_P(RegridType, AnyTurnKeepsValuesValid) {
  Random random(77);
  const Map map = random_map(GetParam(), frame_of(0, 0, 12'800'000), 4, random);
  const Map turned = read(*regrid(map, frame_of(1'234'567, 0, 10'000'000),
                                  {.shift_m = {0.123, 4.5}, .yaw_rad = 0.7, .pivot_m = {3, -2}}));
  EXPECT_GT(turned.size(), 0u);
}

std::vector<LayerType> area_types() {
  std::vector<LayerType> types = all_types();
  std::erase_if(
      types, [](const LayerType& t) { return t.policy == Policy::kMedian || t.policy == Policy::kDempster; });
  return types;
}
std::string name_of(const testing::TestParamInfo<LayerType>& test) { return test.param.name; }
INSTANTIATE_TEST_SUITE_P(All, RegridType, testing::ValuesIn(all_types()), name_of);
INSTANTIATE_TEST_SUITE_P(All, RegridAreaType, testing::ValuesIn(area_types()), name_of);

TEST(Regrid, ConservesLambda) {
  Random random(78);
  const LayerType type = LayerType::occupancy();
  Map map = map_of(type, frame_of(0, 0, 12'800'000));
  for (const PatchIndex index : {PatchIndex{0, 0}, PatchIndex{1, 1}}) {
    for (float& o : map.layer(index, 0, 5).plane(0)) o = 0.8f * test::uniform(random);
  }
  const double want = static_cast<double>(total_lambda(map));
  for (const double yaw : {0.0, 0.3, 2.0}) {
    for (const std::int64_t edge_um : {12'800'000, 10'000'000, 7'680'000}) {
      const auto source = regrid(map, frame_of(3'333'333, -77'777, edge_um), {.yaw_rad = yaw});
      EXPECT_NEAR(static_cast<double>(total_lambda(read(*source))) / want, 1, 2e-6) << yaw << " " << edge_um;
    }
  }
}

TEST(Regrid, CountsAreConserved) {
  const LayerType type = LayerType::real("points", {"n"}, Policy::kSum);
  Map map = map_of(type, frame_of(0, 0, 12'800'000));
  map.layer({0, 0}, 0, 3).plane(0)[9] = 100.0f;
  double sum = 0;
  const Map out = read(*regrid(map, frame_of(55'555, 0, 9'999'999), {.yaw_rad = 1.0}));
  for (const auto& [key, patch] : out.by_key()) {
    for (const float v : patch.layers.at(0).plane(0)) sum += static_cast<double>(v);
  }
  EXPECT_NEAR(sum, 100, 1e-4);
}

TEST(Regrid, AreaWeightsAreThoseOfTheTheory) {
  // One cell of 1 m with m(O) = .9, half a cell off: a quarter of its lambda in each of four cells.
  const LayerType type = LayerType::occupancy();
  Map map = map_of(type, frame_of(0, 0, 4'000'000));
  map.layer({0, 0}, 0, 2).at(0, {1, 1}) = 0.9f;
  const Map out = read(*regrid(map, frame_of(-500'000, -500'000, 4'000'000)));
  const Layer* layer = out.find({0, 0}, 0);
  ASSERT_NE(layer, nullptr);
  for (const CellIndex c : {CellIndex{1, 1}, CellIndex{2, 1}, CellIndex{1, 2}, CellIndex{2, 2}}) {
    EXPECT_NEAR(layer->at(0, c), .437659, 1e-6);
  }
  EXPECT_EQ(layer->at(0, {3, 1}), 0.0f);
}

TEST(Regrid, UncoveredAreaIsVacuous) {
  const LayerType type = LayerType::occupancy("free", Policy::kConditional);
  Map map = map_of(type, frame_of(0, 0, 4'000'000));
  for (float& f : map.layer({0, 0}, 0, 2).plane(1)) f = 0.8f;
  const Map out = read(*regrid(map, frame_of(-500'000, 0, 4'000'000)));
  EXPECT_NEAR(out.find({0, 0}, 0)->at(1, {0, 0}), 0.4, 1e-6);
  EXPECT_NEAR(out.find({0, 0}, 0)->at(1, {1, 0}), 0.8, 1e-6);
  EXPECT_NEAR(out.find({1, 0}, 0)->at(1, {0, 0}), 0.4, 1e-6);
}

TEST(Regrid, MixedStepsTakeTheFinest) {
  const LayerType type = LayerType::occupancy();
  Map map = map_of(type, frame_of(0, 0, 12'800'000));
  map.layer({0, 0}, 0, 3).plane(0)[0] = 0.5f;
  map.layer({1, 0}, 0, 5).plane(0)[0] = 0.5f;
  const auto source = regrid(map, frame_of(6'400'000, 0, 12'800'000));
  const Map out = read(*source);
  EXPECT_EQ(out.find({-1, 0}, 0)->step(), 3);
  EXPECT_EQ(out.find({0, 0}, 0)->step(), 5);
  EXPECT_EQ(source->summary().patches, 3u);
}

TEST(Regrid, FarFromTheOriginStaysExact) {
  Random random(79);
  const LayerType type = LayerType::occupancy();
  const Frame utm = frame_of(573'100'000'000, 5'362'900'000'000, 12'800'000);
  const Map map = random_map(type, utm, 4, random);
  const Frame moved = frame_of(utm.datum_x_um + 800'000, utm.datum_y_um - 1'600'000, 12'800'000);
  expect_same(map, read(*regrid(read(*regrid(map, moved)), utm)), 0);
}

TEST(Regrid, RefusesWhatCannotBeDone) {
  const LayerType type = LayerType::occupancy();
  Map map = map_of(type, frame_of(0, 0, 12'800'000));
  map.layer({0, 0}, 0, 5).plane(0)[0] = 0.5f;
  EXPECT_THROW(regrid(map, frame_of(0, 0, 10)), Error);
  EXPECT_THROW(regrid(map, frame_of(0, 0, 1'000)), Error);  // 163 million patches
  EXPECT_THROW(regrid(map, map.header().frame, {.yaw_rad = NAN}), Error);
  EXPECT_THROW(regrid(map, map.header().frame, {.shift_m = {INFINITY, 0}}), Error);
  EXPECT_THROW(regrid(map, map.header().frame, {}, 12), Error);
  EXPECT_THROW(regrid(map, frame_of(0, 0, 10'000'000'000)), Error);  // cells of 0.4 m need step 15
  Map edge = map_of(type, frame_of(0, 0, 12'800'000));
  edge.layer({2'147'483'647, 0}, 0, 1).plane(0)[0] = 0.5f;
  EXPECT_THROW(regrid(edge, frame_of(0, 0, 6'400'000)), Error);
  const auto source = regrid(map, map.header().frame);
  LayerInfo info;
  info.patch = {5, 5};
  Layer out;
  EXPECT_THROW(source->load(info, out), Error);
}

}  // namespace
}  // namespace apgm

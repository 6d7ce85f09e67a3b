#include "apgm/ops/crop.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "apgm/ops/copy.hpp"
#include "random_map.hpp"
#include "stored_map.hpp"

namespace apgm {
namespace {

using test::difference;
using test::random_map;

struct Cropped {
  Map map;
  CropReport report;
};

Cropped crop_of(const PatchSource& source, const CropRegion& region, const CropOptions& options = {},
                const RunOptions& run = {}) {
  Cropped c{Map(crop_header(source, region, options)), {}};
  test::StoredSink sink(c.map);
  c.report = crop(source, region, options, sink, run);
  sink.finish();
  return c;
}

/// The definition: walk every cell, keep it if its area meets the box.
Map crop_by_hand(const Map& map, const Box& box) {
  Map out(map.header());
  const Frame& frame = map.header().frame;
  for (const auto& [key, patch] : map.by_key()) {
    for (const auto& [id, layer] : patch.layers) {
      const LayerType& type = map.header().types[id];
      Layer& kept = out.layer(patch.index, id, layer.step());
      const double cell = frame.cell_m(layer.step());
      const Point origin = frame.origin_m(patch.index);
      for (int b = 0; b < layer.side(); ++b) {
        for (int a = 0; a < layer.side(); ++a) {
          const double x = origin.x_m + a * cell, y = origin.y_m + b * cell;
          const bool in = x + cell > box.min.x_m + 1e-9 && x < box.max.x_m - 1e-9 &&
                          y + cell > box.min.y_m + 1e-9 && y < box.max.y_m - 1e-9;
          for (int c = 0; c < layer.channels(); ++c) {
            kept.at(c, {a, b}) = in ? layer.at(c, {a, b}) : type.background(c);
          }
        }
      }
    }
  }
  out.prune();
  return out;
}

TEST(Crop, KeepsTheCellsThatShareAreaWithTheBox) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    test::Random random(seed);
    const Map map = random_map(seed);
    const Point min{random.in(-400, 200) * 0.1, random.in(-400, 200) * 0.1};
    const Box box{min, {min.x_m + random.in(1, 300) * 0.1, min.y_m + random.in(1, 300) * 0.1}};
    const test::StoredSource source(map);
    const Cropped c = crop_of(source, {box, {}, nullptr});
    EXPECT_EQ(difference(c.map, crop_by_hand(map, box)), "");
    EXPECT_EQ(c.report.patches, c.map.size());
    EXPECT_EQ(c.report.salvaged, 0u);
  }
}

TEST(Crop, PassesWhollyCoveredPatchesAsStored) {
  const Map map = random_map(7);
  const test::StoredSource source(map);
  const Cropped c = crop_of(source, {Box{{-1000, -1000}, {1000, 1000}}, {}, nullptr});
  EXPECT_EQ(difference(map, c.map, true), "");
  EXPECT_EQ(c.report.layers_stored, c.report.layers);
  EXPECT_EQ(source.loads, 0);
}

TEST(Crop, LoadsOnlyBorderLayers) {
  test::RandomMapOptions options;
  options.fill = 1;
  const Map map = random_map(3, options);
  const test::StoredSource source(map);
  // 2 x 2 whole patches and a rim of 12 more: at most 4 layers each are cut.
  const double e = map.header().frame.edge_m();
  const Cropped c = crop_of(source, {Box{{-1.5 * e, -1.5 * e}, {1.5 * e, 1.5 * e}}, {}, nullptr});
  EXPECT_GT(source.loads, 0);
  EXPECT_LE(source.loads, 12 * 4);
  EXPECT_GE(source.stored_loads, 2 * 2 * 4 - 4);
  EXPECT_EQ(c.report.patches, c.map.size());
}

TEST(Crop, SnapsToPatches) {
  const Map map = random_map(11);
  const test::StoredSource source(map);
  CropOptions options;
  options.snap = Snap::kPatch;
  const Cropped c = crop_of(source, {Box{{-1, -1}, {1, 1}}, {}, nullptr}, options);
  EXPECT_EQ(source.loads, 0);
  for (const auto& [key, patch] : c.map.by_key()) {
    EXPECT_TRUE((PatchRange{{-1, -1}, {0, 0}}.contains(patch.index)));
    for (const auto& [type, layer] : patch.layers) {
      EXPECT_TRUE(same_cells(layer, *map.find(patch.index, type)));
    }
  }
}

TEST(Crop, APolygonThatIsABoxKeepsTheSameCells) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    SCOPED_TRACE(seed);
    const Map map = random_map(seed);
    // On cell borders of the coarsest step, centres inside and shared area are the same question.
    const Box box{{-6.4, -19.2}, {12.8, 25.6}};
    const Polygon polygon{{{box.min, {box.max.x_m, box.min.y_m}, box.max, {box.min.x_m, box.max.y_m}}}};
    EXPECT_EQ(difference(crop_of(map, {{}, polygon, nullptr}).map, crop_of(map, {box, {}, nullptr}).map), "");
  }
}

TEST(Crop, KeepsThePatchesOfTheMapItIsCroppedLike) {
  const Map map = random_map(1), like = random_map(2);
  const Cropped c = crop_of(map, {{}, {}, &like});
  std::size_t expected = 0;
  for (const auto& [key, patch] : map.by_key()) expected += like.find(patch.index) != nullptr;
  EXPECT_GT(expected, 0u);
  EXPECT_EQ(c.map.size(), expected);
  for (const auto& [key, patch] : c.map.by_key()) EXPECT_NE(like.find(patch.index), nullptr);
}

TEST(Crop, RefusesALikenessOnAnotherFrame) {
  const Map map = random_map(1);
  test::RandomMapOptions options;
  options.frame.datum_x_um = 1;
  const Map like = random_map(2, options);
  try {
    crop_header(map, {{}, {}, &like}, {});
    FAIL() << "no failure";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kIncompatible);
  }
}

TEST(Crop, KeepsTheNamedLayersOnly) {
  const Map map = random_map(5);
  CropOptions options;
  options.layers = {"semantic", "occupancy"};
  const Cropped c = crop_of(map, {}, options);
  ASSERT_EQ(c.map.header().types.size(), 2u);
  EXPECT_EQ(c.map.header().types[0].name, "occupancy");
  EXPECT_GT(c.report.layers, 0u);
  for (const auto& [key, patch] : c.map.by_key()) {
    for (const auto& [id, layer] : patch.layers) {
      const TypeId original = *map.header().types.find(c.map.header().types[id].name);
      EXPECT_TRUE(same_cells(layer, *map.find(patch.index, original)));
    }
  }
  options.layers = {"velocity"};
  try {
    crop_header(map, {}, options);
    FAIL() << "no failure";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kInvalidArgument);
    EXPECT_THAT(e.hint(), testing::HasSubstr("height, hits, occupancy, semantic"));
  }
}

TEST(Crop, OutsideTheMapGivesAnEmptyMap) {
  const Cropped c = crop_of(random_map(5), {Box{{1e6, 1e6}, {1e6 + 1, 1e6 + 1}}, {}, nullptr});
  EXPECT_EQ(c.map.size(), 0u);
  EXPECT_EQ(c.report.patches, 0u);
  const Map empty((MapHeader()));
  EXPECT_EQ(crop_of(random_map(5), {{}, {}, &empty}).report.patches, 0u);
}

TEST(Crop, RefusesBoxesThatAreNone) {
  const Map map = random_map(5);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Box& box : {Box{{1, 1}, {0, 2}}, Box{{1, 1}, {1, 2}}, Box{{nan, 0}, {1, 1}}}) {
    try {
      crop_header(map, {box, {}, nullptr}, {});
      FAIL() << "no failure";
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kInvalidArgument);
    }
  }
}

TEST(Crop, SalvagesWhatIsNotDamaged) {
  const Map map = random_map(9);
  test::StoredSource source(map);
  source.damaged = map.by_key().begin()->second.index;
  const std::size_t lost = map.by_key().begin()->second.layers.size();
  for (const int threads : {1, 2}) {
    RunOptions run;
    run.threads = threads;
    std::size_t findings = 0;
    run.findings = [&](const Finding& f) { findings += f.kind == Finding::Kind::kLoss; };
    EXPECT_THROW(crop_of(source, {}, {}, run), Error);
    CropOptions options;
    options.salvage = true;
    const Cropped c = crop_of(source, {}, options, run);
    EXPECT_EQ(c.report.salvaged, lost);
    EXPECT_EQ(findings, lost);
    EXPECT_EQ(c.map.size(), map.size() - 1);
  }
}

TEST(Crop, GivesTheSameForAnyThreadCount) {
  const Map map = random_map(21);
  const CropRegion region{{}, Polygon{{{{-30, -20}, {25, -31}, {19, 30}, {-5, 3}}}}, nullptr};
  RunOptions one, two;
  one.threads = 1;
  two.threads = 2;
  EXPECT_EQ(difference(crop_of(map, region, {}, one).map, crop_of(map, region, {}, two).map, true), "");
}

TEST(CropHeader, TellsWhatWasDone) {
  const MapHeader header = crop_header(random_map(1), {Box{{0, 0}, {1.5, 2}}, {}, nullptr}, {});
  ASSERT_EQ(header.history.size(), 1u);
  EXPECT_EQ(header.history[0].operation, "crop");
  EXPECT_EQ(header.history[0].parameters, R"({"bbox_m":[0,0,1.5,2],"snap":"cell"})");
}

TEST(Copy, PassesStoredBytesUnlessToldToReencode) {
  const Map map = random_map(4);
  for (const bool reencode : {false, true}) {
    const test::StoredSource source(map);
    Map out(map.header());
    test::StoredSink sink(out);
    const CopyReport report = copy(source, out.header().types, sink, reencode);
    EXPECT_EQ(difference(map, out, true), "");
    EXPECT_EQ(report.patches, map.size());
    EXPECT_EQ(report.layers_stored, reencode ? 0u : report.layers);
    EXPECT_EQ(source.loads == 0, !reencode);
  }
}

TEST(Copy, GivesCellsToASinkThatTakesNoStoredBytes) {
  const Map map = random_map(4);
  const test::StoredSource source(map);
  Map out(map.header());
  MapSink sink(out);
  EXPECT_EQ(copy(source, out.header().types, sink, false).layers_stored, 0u);
  EXPECT_EQ(difference(map, out, true), "");
}

TEST(Copy, FindsTypesByName) {
  const Map map = random_map(4);
  MapHeader header = map.header();
  header.types = TypeTable({LayerType::occupancy("a"), map.header().types[0], map.header().types[1],
                            map.header().types[2], map.header().types[3]});
  Map out(header);
  MapSink sink(out);
  copy(map, out.header().types, sink, false);
  for (const auto& [key, patch] : map.by_key()) {
    for (const auto& [id, layer] : patch.layers) {
      ASSERT_NE(out.find(patch.index, static_cast<TypeId>(id + 1)), nullptr);
    }
  }
}

TEST(Copy, RefusesATypeThatMeansSomethingElse) {
  const Map map = random_map(4);
  Map out(MapHeader{{}, TypeTable({LayerType::real("occupancy", {"p"})}), {}, {}, 0});
  MapSink sink(out);
  EXPECT_THROW(copy(map, out.header().types, sink, false), Error);
}

}  // namespace
}  // namespace apgm

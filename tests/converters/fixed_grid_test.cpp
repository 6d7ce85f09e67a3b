#include "converters/fixed_grid/fixed_grid.hpp"

#include <cmath>
#include <cstring>

#include "apgm/layouts/moving_grid.hpp"
#include "converters/fixed_grid/layout_file.hpp"
#include "converters/fixed_grid/losses.hpp"
#include "random_map.hpp"
#include "tests/converters/support.hpp"

namespace apgm::converters {
namespace {

using testing::collect;
using testing::error_of;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::open;
using ::testing::SizeIs;
using testing::write;

test::RandomMapOptions site(int min_step = 4, int max_step = 7) {
  test::RandomMapOptions options;
  options.frame.datum_x_um = 573'100'000'000;
  options.frame.datum_y_um = -5'362'900'000'000;
  options.frame.epsg = 32632;
  options.frame.frame_id = "site";
  options.min_step = min_step;
  options.max_step = max_step;
  options.range = {{-9, -2}, {8, 1}};
  return options;
}

std::vector<std::unique_ptr<Layout>> layouts_of(const Map& map) {
  const CellSchema schema(map.header().types);
  const Frame& frame = map.header().frame;
  std::vector<std::unique_ptr<Layout>> all;
  for (const char* name : {"A", "B", "C"}) {
    all.push_back(make_nonuniform_grid(schema, frame, buerkle_preset(name)));
  }
  all.push_back(make_moving_grid(schema, frame, 0.2, 30));
  for (const SubMapContainer c : kSubMapContainers) {
    all.push_back(make_submap_grid(schema, frame, 0.4, c, 60));
  }
  const Point d = frame.datum_m();
  for (const auto& layout : all) {
    layout->move_to({d.x_m + 3.3, d.y_m - 7.1});
    fill(*layout, map);
    layout->move_to({d.x_m + 14.3, d.y_m - 2.2});
  }
  return all;
}

/// The bits of all cells, by where they are.
std::map<std::pair<std::int64_t, std::int64_t>, std::string> bits_of(const Layout& layout) {
  std::map<std::pair<std::int64_t, std::int64_t>, std::string> out;
  const auto bytes = static_cast<std::size_t>(layout.schema().values()) * sizeof(float);
  layout.for_each_block([&](const CellBlock& block) {
    for (int b = 0; b < block.rows; ++b) {
      for (int a = 0; a < block.columns; ++a) {
        const float* cell = block.cells + b * block.row_stride + std::int64_t{a} * layout.schema().values();
        out[{block.x_um + a * block.cell_x_um, block.y_um + b * block.cell_y_um}].assign(
            reinterpret_cast<const char*>(cell), bytes);
      }
    }
  });
  return out;
}

TEST(LayoutFile, KeepsEveryBitOfEveryLayout) {
  const Map map = test::random_map(81, site());
  for (const auto& layout : layouts_of(map)) {
    const auto bytes = encode_layout(*layout);
    const auto back = decode_layout(bytes);
    EXPECT_EQ(back->name(), layout->name());
    EXPECT_EQ(back->frame(), layout->frame());
    EXPECT_EQ(back->schema().types(), layout->schema().types());
    EXPECT_TRUE(bits_of(*back) == bits_of(*layout)) << layout->name();
    EXPECT_EQ(encode_layout(*back), bytes) << layout->name();
    EXPECT_LT(bytes.size(), layout->footprint().value_bytes() / 4);
  }
}

TEST(LayoutFile, TellsDamage) {
  test::RandomMapOptions options = site(3, 4);
  options.range = {{0, 0}, {1, 1}};
  const Map map = test::random_map(82, options);
  test::Random random(83);
  for (const SubMapContainer c : {SubMapContainer::kHashMap, SubMapContainer::kQuadtree}) {
    const auto layout = make_submap_grid(CellSchema(map.header().types), options.frame, 0.8, c);
    fill(*layout, map);
    const auto whole = encode_layout(*layout);
    for (std::size_t end = 0; end < whole.size(); end += end < 400 ? 1 : 37) {
      EXPECT_THROW(decode_layout(std::span(whole).first(end)), Error) << end;
    }
    for (int i = 0; i < 1500; ++i) {
      auto bytes = whole;
      const auto at = static_cast<std::size_t>(random.below(static_cast<int>(i < 700 ? 400 : bytes.size())));
      bytes[at] ^= static_cast<std::byte>(1 << random.below(8));
      EXPECT_THROW(decode_layout(bytes), Error) << "byte " << at;
    }
    EXPECT_EQ(error_of([&] { decode_layout(whole, 100); }).code(), ErrorCode::kLimit);
  }
  EXPECT_EQ(error_of([] { decode_layout({}); }).code(), ErrorCode::kForeign);
}

TEST(FixedGridConverter, ReadsBackWhatTheLayoutHolds) {
  const testing::TempDir dir;
  const Map map = test::random_map(84, site());
  for (const char* name : {"A", "C", "moving", "quadtree", "dense_array"}) {
    const std::string path = dir / (std::string(name) + ".apfg");
    write(fixed_grid(), map, path, {{"layout", name}, {"vehicle", "573100,-5362900"}, {"cell_m", "0.2"}});
    const auto bytes = testing::read_text(path);
    const auto layout = decode_layout(std::as_bytes(std::span(bytes)));
    const Map back = collect(*open(fixed_grid(), path));
    EXPECT_EQ(test::difference(back, to_map(*layout, map.header().frame)), "") << name;
    EXPECT_EQ(back.header().frame, map.header().frame);
    EXPECT_GT(back.size(), 0u);
    const auto head = std::as_bytes(std::span(bytes).first(100));
    EXPECT_TRUE(fixed_grid().sniffs(path, head));
  }
}

TEST(FixedGridConverter, SubMapsOfOneResolutionLoseNothing) {
  const testing::TempDir dir;
  const Map map = test::random_map(85, site(5, 5));
  testing::Collected findings;
  write(fixed_grid(), map, dir / "a.apfg", {{"layout", "cow_tiles"}}, &findings);
  EXPECT_THAT(findings.list, IsEmpty());
  EXPECT_EQ(test::difference(map, collect(*open(fixed_grid(), dir / "a.apfg"))), "");
}

TEST(FixedGridConverter, TellsTheTrueLoss) {
  const testing::TempDir dir;
  test::RandomMapOptions options = site(7, 7);
  options.types = {LayerType::occupancy()};
  const Map map = test::random_map(86, options);
  testing::Collected findings;
  write(fixed_grid(), map, dir / "a.apfg", {{"vehicle", "573100,-5362900"}}, &findings);
  ASSERT_THAT(findings.losses(), SizeIs(2));

  // What is kept, counted cell by cell in what is read back.
  const Map back = collect(*open(fixed_grid(), dir / "a.apfg"));
  std::uint64_t known = 0, near = 0, outside = 0;
  for (const auto& [key, patch] : map.by_key()) {
    const Layer& layer = patch.layers.at(0);
    const Layer* out = back.find(patch.index, 0);
    const Point origin = map.header().frame.origin_m(patch.index);
    for (int b = 0; b < layer.side(); ++b) {
      for (int a = 0; a < layer.side(); ++a) {
        if (layer.at(0, {a, b}) == 0 && layer.at(1, {a, b}) == 0) continue;
        ++known;
        const double x = std::fabs(origin.x_m + 0.1 * a + 0.05 - 573'100);
        const double y = std::fabs(origin.y_m + 0.1 * b + 0.05 + 5'362'900);
        if (std::max(x, y) > 100) {
          ++outside;
        } else if (std::max(x, y) < 20) {
          ASSERT_NE(out, nullptr);
          ASSERT_EQ(out->at(0, {a, b}), layer.at(0, {a, b}));
          ASSERT_EQ(out->at(1, {a, b}), layer.at(1, {a, b}));
          ++near;
        }
      }
    }
  }
  EXPECT_GT(outside, 0u);
  const std::string of = " of " + std::to_string(known) + " cells with data ";
  EXPECT_EQ(findings.losses()[0],
            "layer 'occupancy': " + std::to_string(outside) + of + "lie outside the layout and are lost");
  EXPECT_EQ(findings.losses()[1], "layer 'occupancy': " + std::to_string(known - outside - near) + of +
                                      "are merged into larger ones");
}

TEST(FixedGridConverter, TakesOneLayer) {
  const testing::TempDir dir;
  const Map map = test::random_map(87, site(5, 5));
  write(fixed_grid(), map, dir / "a.apfg", {{"layout", "hash_map"}}, nullptr, "semantic");
  const Map back = collect(*open(fixed_grid(), dir / "a.apfg"));
  EXPECT_EQ(back.header().types.size(), 1u);
  EXPECT_GT(back.size(), 0u);
  EXPECT_THAT(error_of([&] { write(fixed_grid(), map, dir / "b.apfg", {}, nullptr, "none"); }).message(),
              HasSubstr("'none'"));
}

TEST(FixedGridConverter, ReadsPlans) {
  const testing::TempDir dir;
  const Map map = test::random_map(88, site(5, 5));
  const std::string plan = testing::write_text(
      dir / "plan.yaml", "name: strip\nrectangles: [{x_m: [-40, 40], y_m: [-8, 8], cell_m: 0.4}]\n");
  write(fixed_grid(), map, dir / "a.apfg", {{"plan", plan}});
  EXPECT_EQ(collect(*open(fixed_grid(), dir / "a.apfg")).header().frame, map.header().frame);
  testing::write_text(plan,
                      "rectangles: [{x_m: [0, 4], y_m: [0, 4], cell_m: 0.4},"
                      " {x_m: [2, 6], y_m: [0, 4], cell_m: 0.4}]");
  EXPECT_THAT(error_of([&] {
                write(fixed_grid(), map, dir / "b.apfg", {{"plan", plan}});
              }).message(),
              HasSubstr("rectangles 1 and 2 overlap"));
  EXPECT_FALSE(std::filesystem::exists(dir / "b.apfg"));
  EXPECT_THROW(write(fixed_grid(), map, plan, {{"plan", plan}}, nullptr, "", true), Error);
  EXPECT_THAT(testing::read_text(plan), HasSubstr("rectangles"));
}

TEST(FixedGridConverter, TellsWhichCellsAreSplitInReading) {
  const testing::TempDir dir;
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  // In A round the datum: 0.1 m up to x = 20 m, 0.2 m from there on, in the patch that holds both.
  map.layer({1, 0}, 0, 7).at(0, {0, 0}) = 0.5f;
  for (int a = 80; a < 86; ++a) map.layer({1, 0}, 0, 7).at(1, {a, 0}) = 0.5f;
  write(fixed_grid(), map, dir / "a.apfg", {{"vehicle", "0,0"}});
  testing::Collected findings;
  const Map back = collect(*open(fixed_grid(), dir / "a.apfg", {}, &findings));
  EXPECT_THAT(findings.losses(), IsEmpty());
  EXPECT_THAT(findings.of(Finding::Kind::kNote),
              ::testing::ElementsAre("layer 'occupancy': 3 cells with data are split into smaller ones"));
  EXPECT_EQ(back.find({1, 0}, 0)->at(1, {85, 1}), 0.25f);
}

TEST(FixedGridConverter, ReadsOntoAnotherFrame) {
  const testing::TempDir dir;
  const Map map = test::random_map(91, site(5, 5));
  write(fixed_grid(), map, dir / "a.apfg", {{"layout", "hash_map"}});
  const Map back = collect(*open(fixed_grid(), dir / "a.apfg", {{"edge_m", "6.4"}, {"frame_id", "other"}}));
  EXPECT_EQ(back.header().frame.edge_um, 6'400'000);
  EXPECT_EQ(back.header().frame.frame_id, "other");
  EXPECT_GT(back.size(), map.size());
  const auto act = [&] { open(fixed_grid(), dir / "a.apfg", {{"datum", "0.1,0"}}); };
  EXPECT_EQ(error_of(act).code(), ErrorCode::kIncompatible);
}

TEST(FixedGridConverter, RefusesSettingsThatDoNotFit) {
  const testing::TempDir dir;
  const Map map = test::random_map(89, site(5, 5));
  for (const Settings& bad : {Settings{{"layout", "D"}}, Settings{{"vehicle", "1"}},
                              Settings{{"cell_m", "0"}}, Settings{{"layout", "hash_map"}, {"cell_m", "0.3"}},
                              Settings{{"layout", "moving"}, {"half_extent_m", "0.5"}, {"cell_m", "0.4"}},
                              Settings{{"plan", "x"}, {"layout", "A"}}, Settings{{"speed", "1"}}}) {
    EXPECT_EQ(error_of([&] { write(fixed_grid(), map, dir / "a.apfg", bad); }).code(),
              ErrorCode::kInvalidArgument);
  }
  EXPECT_THAT(dir.list(), IsEmpty());
  EXPECT_EQ(error_of([&] { open(fixed_grid(), dir / "none.apfg"); }).code(), ErrorCode::kUnreadable);
  testing::write_text(dir / "c.apfg", "APGMFIXGxxxx");
  const Error damaged = error_of([&] { open(fixed_grid(), dir / "c.apfg"); });
  EXPECT_EQ(damaged.code(), ErrorCode::kDamaged);
  EXPECT_EQ(damaged.path(), dir / "c.apfg");
}

TEST(CellFates, CountSplitCellsToo) {
  const Map map = test::random_map(90, site(4, 4));
  const auto layout =
      make_submap_grid(CellSchema(map.header().types), map.header().frame, 0.4, SubMapContainer::kHashMap);
  fill(*layout, map);
  for (const CellFates& f : cell_fates(*layout, map)) {
    EXPECT_GT(f.known, 0u);
    EXPECT_EQ(f.split, f.known);
    EXPECT_EQ(f.merged + f.outside, 0u);
  }
}

}  // namespace
}  // namespace apgm::converters

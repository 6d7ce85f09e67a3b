#include "apgm/ops/diff.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <limits>

#include "apgm/format/reader.hpp"
#include "apgm/fuse/resample.hpp"
#include "diffs.hpp"

namespace apgm {
namespace {

using test::belief;
using test::compare;
using test::file_of;
using test::same_spaces;

TEST(Diff, OfAMapAndACopyInAnyDressIsEmpty) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE(seed);
    const Map map = test::random_map(seed);
    WriterOptions tight;
    tight.level = 19;
    WriterOptions loose;
    loose.level = 1;
    const auto first = file_of(map, tight), second = file_of(map, loose);
    const Reader a(first), b(second);
    const PatchSource* sources[] = {&map, &a, &b};
    for (const DiffLevel level : {DiffLevel::kBytes, DiffLevel::kCells, DiffLevel::kBelief}) {
      for (const PatchSource* left : sources) {
        for (const PatchSource* right : sources) {
          DiffOptions options;
          options.level = level;
          options.regions = level != DiffLevel::kBytes;
          const DiffReport report = compare(*left, *right, options);
          EXPECT_FALSE(report.different);
          EXPECT_EQ(report.patches_added + report.patches_removed + report.patches_changed, 0u);
          EXPECT_EQ(report.patches_equal, map.size());
          EXPECT_TRUE(report.regions.empty());
          EXPECT_TRUE(report.header_differences.empty());
          for (const TypeDiff& type : report.types) {
            EXPECT_EQ(type.layers_equal,
                      map.summary().types[*map.header().types.find(type.type.name)].layers);
            EXPECT_EQ(type.compared.cells, 0u);
          }
        }
      }
    }
  }
}

TEST(Diff, KnownHashesSpareTheReading) {
  Map map = test::random_map(3);
  const auto before = file_of(map);
  const auto& [key, patch] = *map.by_key().begin();
  map.layer(patch.index, patch.layers.begin()->first, 0).plane(0)[0] = 0.125f;
  const auto after = file_of(map);
  const Reader a(before), b(after);
  struct Counting final : PatchSource {
    explicit Counting(const PatchSource& s) : source(s) {}
    const MapHeader& header() const override { return source.header(); }
    Summary summary() const override { return source.summary(); }
    std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range) const override {
      return source.patches(range);
    }
    void load(const LayerInfo& info, Layer& out) const override {
      ++loads;
      source.load(info, out);
    }
    const PatchSource& source;
    mutable std::atomic<int> loads{0};
  };
  const Counting left(a), right(b);
  EXPECT_TRUE(compare(left, right).different);
  EXPECT_EQ(left.loads, 1);
  EXPECT_EQ(right.loads, 1);
  DiffOptions bytes;
  bytes.level = DiffLevel::kBytes;
  EXPECT_TRUE(compare(left, right, bytes).different);
  EXPECT_EQ(left.loads + right.loads, 2);
}

/// The report of diff(b, a) as diff(a, b) should have it.
DiffReport mirrored(DiffReport report) {
  std::swap(report.patches_added, report.patches_removed);
  for (TypeDiff& type : report.types) {
    std::swap(type.layers_added, type.layers_removed);
    std::swap(type.learned, type.forgotten);
    std::swap(type.free_to_occupied, type.occupied_to_free);
    type.kl_divergence = 0;
    type.type.policy = {};
  }
  return report;
}

TEST(Diff, IsMirrored) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE(seed);
    const Map a = test::random_map(seed);
    const Map b = test::edited_map(a, seed + 100, same_spaces());
    for (const double tolerance : {-1.0, 0.0, 0.3}) {
      DiffOptions options = tolerance < 0 ? DiffOptions{} : belief(tolerance);
      options.regions = true;
      const DiffReport there = compare(a, b, options), back = compare(b, a, options);
      DiffReport expected = there;
      for (TypeDiff& type : expected.types) {
        type.kl_divergence = 0;
        type.type.policy = {};
      }
      EXPECT_EQ(expected, mirrored(back));
      EXPECT_TRUE(there.different || tolerance > 0);
    }
  }
}

TEST(Diff, KindsAddUp) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE(seed);
    const Map a = test::random_map(seed);
    const Map b = test::edited_map(a, seed + 200, same_spaces());
    for (const double tolerance : {0.0, 0.2, 2.0}) {
      const DiffReport report = compare(a, b, belief(tolerance));
      std::uint64_t left = 0, right = 0;
      for (const TypeDiff& t : report.types) {
        EXPECT_EQ(t.changed.cells, t.learned.cells + t.forgotten.cells + t.free_to_occupied.cells +
                                       t.occupied_to_free.cells + t.class_changed.cells + t.adjusted.cells);
        EXPECT_LE(t.changed.cells, t.compared.cells);
        EXPECT_LE(t.jousselme.max, 1.0);
        EXPECT_LE(t.conflict.max, 1.0);
        EXPECT_GE(t.kl_divergence, 0.0);
        left += t.layers_removed + t.layers_changed + t.layers_equal;
        right += t.layers_added + t.layers_changed + t.layers_equal;
        EXPECT_TRUE(t.changed.cells == 0 || tolerance < 2.0 || !t.type.is_evidence());
      }
      std::uint64_t layers_a = 0, layers_b = 0;
      for (const auto& type : a.summary().types) layers_a += type.layers;
      for (const auto& type : b.summary().types) layers_b += type.layers;
      EXPECT_EQ(left, layers_a);
      EXPECT_EQ(right, layers_b);
      EXPECT_EQ(report.patches_removed + report.patches_changed + report.patches_equal, a.size());
      EXPECT_EQ(report.patches_added + report.patches_changed + report.patches_equal, b.size());
    }
  }
}

TEST(Diff, IsTheSameForAnyThreadCountAndAnySource) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SCOPED_TRACE(seed);
    test::RandomMapOptions wide;
    wide.range = {{-9, -9}, {9, 9}};
    const Map a = test::random_map(seed, wide);
    const Map b = test::edited_map(a, seed + 300, same_spaces());
    const auto bytes_a = file_of(a), bytes_b = file_of(b);
    const Reader file_a(bytes_a), file_b(bytes_b);
    DiffOptions options;
    options.regions = true;
    const DiffReport one = compare(a, b, options, 1);
    EXPECT_EQ(one, compare(a, b, options, 2));
    EXPECT_EQ(one, compare(file_a, file_b, options, 2));
  }
}

TEST(Diff, LayersOfTwoStepsAreComparedAtTheCoarser) {
  test::RandomMapOptions steps;
  steps.min_step = steps.max_step = 4;
  const Map fine = test::random_map(5, steps);
  Map coarse(fine.header());
  for (const auto& [key, patch] : fine.by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      resample(layer, fine.header().types[type], 2, coarse.patch(patch.index).layers[type]);
    }
  }
  const DiffReport report = compare(fine, coarse, belief(0));
  for (const TypeDiff& type : report.types) {
    EXPECT_GT(type.layers_of_two_steps, 0u);
    EXPECT_EQ(type.changed.cells, 0u);
    EXPECT_GT(type.compared.area_m2, 0);
  }
  EXPECT_FALSE(report.different);
  EXPECT_TRUE(compare(fine, coarse).different);  // other cells, if of equal belief
  EXPECT_EQ(report.types[0].layers_of_two_steps, compare(coarse, fine).types[0].layers_of_two_steps);
}

TEST(Diff, LayersWithoutDataAreNoLayers) {
  const Map a = test::random_map(6);
  Map b = test::random_map(6);
  b.layer({50, 50}, 0, 3);
  const DiffReport report = compare(a, b);
  EXPECT_FALSE(report.different);
  EXPECT_EQ(report.patches_added, 0u);
}

TEST(Diff, DatumsThatDifferByWholeCellsAreBroughtTogether) {
  test::RandomMapOptions options;
  options.min_step = options.max_step = 3;
  const Map a = test::random_map(7, options);
  options.frame.datum_x_um = 3 * 1'600'000;
  options.frame.datum_y_um = -2 * 12'800'000;
  const Map moved = test::random_map(7, options);
  RunOptions run;
  int notes = 0;
  run.findings = [&](const Finding& f) { notes += f.kind == Finding::Kind::kNote; };
  const DiffReport report = diff({&a, "a"}, {&moved, "b"}, {}, run);
  EXPECT_TRUE(report.different);
  EXPECT_EQ(notes, 1);
  EXPECT_EQ(report.header_differences, std::vector<std::string>{"datum"});
  // Cells 3 to the east and 16 to the south: as many known cells as in `moved` lie in its grid.
  MapHeader header = a.header();
  Map back(header);
  for (const auto& [key, patch] : a.by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      for (std::int32_t b = 0; b < 8; ++b) {
        for (std::int32_t c = 0; c < 8; ++c) {
          const std::int64_t x = patch.index.x * 8 + c + 3, y = patch.index.y * 8 + b - 16;
          const PatchIndex at{static_cast<std::int32_t>(floor_div(x, 8)),
                              static_cast<std::int32_t>(floor_div(y, 8))};
          Layer& to = back.layer(at, type, 3);
          for (int k = 0; k < layer.channels(); ++k) {
            to.at(k, {static_cast<std::int32_t>(x & 7), static_cast<std::int32_t>(y & 7)}) =
                layer.at(k, {c, b});
          }
        }
      }
    }
  }
  EXPECT_FALSE(compare(back, moved).different);
}

TEST(Diff, RefusesWhatDoesNotFit) {
  const auto refused = [](const Map& a, const Map& b, const char* what, const char* hint) {
    try {
      compare(a, b);
      ADD_FAILURE() << what << " was taken";
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kIncompatible);
      EXPECT_NE(e.message().find(what), std::string::npos) << e.message();
      EXPECT_NE(e.hint().find(hint), std::string::npos) << e.hint();
    }
  };
  const auto with = [](auto change) {
    MapHeader header;
    header.types = TypeTable({LayerType::occupancy()});
    change(header);
    return Map(header);
  };
  const Map plain = with([](MapHeader& h) { h.frame.epsg = 25832; });
  refused(plain, with([](MapHeader& h) { h.frame.edge_um = 6'400'000; }),
          "patch edges differ (12.8 m and 6.4 m)", "apgm-resample --edge 12.8 --datum 0,0");
  refused(plain, with([](MapHeader& h) { h.frame.datum_x_um = 1; }),
          "datums differ by other than whole cells", "apgm-resample --edge 12.8 --datum 0,0");
  refused(plain, with([](MapHeader& h) { h.frame.frame_id = "odom"; }), "frames differ ('map' and 'odom')",
          "--assume-frame map");
  refused(plain, with([](MapHeader& h) { h.frame.epsg = 25833; }), "(EPSG 25832 and 25833)", "");
  refused(plain, with([](MapHeader& h) {
            LayerType other = LayerType::occupancy();
            other.hypotheses = {"full", "empty"};
            h.types = TypeTable({other});
          }),
          "layer 'occupancy' stands for other hypotheses", "--layer");
}

TEST(Diff, RefusesBadOptions) {
  const Map map = test::random_map(9);
  const auto code = [&](const DiffOptions& options) {
    try {
      compare(map, map, options);
    } catch (const Error& e) {
      return e.code();
    }
    return ErrorCode::kCancelled;
  };
  EXPECT_EQ(code(belief(-1)), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(belief(std::numeric_limits<double>::quiet_NaN())), ErrorCode::kInvalidArgument);
  DiffOptions options;
  options.layers = {"nothing"};
  EXPECT_EQ(code(options), ErrorCode::kInvalidArgument);
  DiffOptions regions;
  regions.level = DiffLevel::kBytes;
  regions.regions = true;
  EXPECT_EQ(code(regions), ErrorCode::kInvalidArgument);
}

TEST(Diff, FiltersByLayerAndBox) {
  const Map a = test::random_map(10), b = test::edited_map(a, 11, same_spaces());
  DiffOptions options;
  options.layers = {"height"};
  const DiffReport whole = compare(a, b), heights = compare(a, b, options);
  ASSERT_EQ(heights.types.size(), 1u);
  EXPECT_EQ(heights.types[0], whole.types[*a.header().types.find("height")]);
  DiffOptions boxed;
  boxed.box = Box{{0, 0}, {12.8, 12.8}};
  const DiffReport part = compare(a, b, boxed);
  EXPECT_LE(part.patches_added + part.patches_removed + part.patches_changed + part.patches_equal, 1u);
}

TEST(Diff, HeadersAreNotesOnly) {
  const Map a = test::random_map(12);
  MapHeader header = a.header();
  header.metadata["who"] = "b";
  header.history.push_back({"edit", {}, "{}"});
  header.stamp_ns = 5;
  std::vector<LayerType> types(header.types.begin(), header.types.end());
  for (LayerType& type : types) {
    if (type.is_occupancy()) type.policy = Policy::kMin;
  }
  header.types = TypeTable(types);
  Map b(header);
  MapSink sink(b);
  copy(a, b.header().types, sink, true);
  const DiffReport report = compare(a, b);
  EXPECT_FALSE(report.different);
  EXPECT_EQ(report.header_differences,
            (std::vector<std::string>{"history", "metadata 'who'", "stamp", "policy of layer 'occupancy'"}));
}

struct Told final : DiffSink {
  void put(PatchIndex patch, int step, std::span<const CellDiff> cells) override {
    EXPECT_EQ(cells.size(), std::size_t{1} << (2 * step));
    for (const CellDiff& cell : cells) {
      known += cell.before != CellDiff::kUnknown || cell.after != CellDiff::kUnknown;
      differ += cell.differs;
    }
    keys.push_back(curve_key(patch));
  }
  std::uint64_t known = 0, differ = 0;
  std::vector<std::uint64_t> keys;
};

TEST(Diff, ASinkIsToldOfEveryCellOfItsLayer) {
  const Map a = test::random_map(13), b = test::edited_map(a, 14, same_spaces());
  for (const int threads : {1, 2}) {
    Told told;
    DiffOptions options;
    options.cells = &told;
    options.cells_layer = "occupancy";
    const DiffReport report = compare(a, b, options, threads);
    const TypeDiff& type = report.types.at(*a.header().types.find("occupancy"));
    EXPECT_EQ(told.differ, type.changed.cells);
    EXPECT_GT(told.known, type.compared.cells);  // equal layers, too
    EXPECT_TRUE(std::ranges::is_sorted(told.keys));
    EXPECT_EQ(told.keys.size(),
              type.layers_added + type.layers_removed + type.layers_changed + type.layers_equal);
  }
}

}  // namespace
}  // namespace apgm

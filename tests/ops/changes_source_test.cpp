#include "apgm/ops/changes_source.hpp"

#include <gtest/gtest.h>

#include "apgm/format/message.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/ops/copy.hpp"
#include "edited_map.hpp"
#include "stored_map.hpp"
#include "watched_source.hpp"

namespace apgm {
namespace {

using test::difference;
using test::edited_map;
using test::random_map;
using test::WatchedSource;

WriterOptions at_level(int level) {
  WriterOptions options;
  options.level = level;
  return options;
}

/// `base` with the changes made, as `other` would be.
Map changed(const Map& base, const ChangesSource& changes) {
  const TypeTable& types = changes.header().types;
  Map out(changes.header());
  for (const auto& [key, patch] : base.by_key()) {
    for (const auto& [id, layer] : patch.layers) {
      const LayerType& type = base.header().types[id];
      const MapChanges::Gone place{patch.index, type.name};
      if (std::ranges::find(changes.gone(), place) != changes.gone().end()) continue;
      const auto to = types.find(type.name);
      if (to && types[*to].same_space(type)) out.patch(patch.index).layers[*to] = layer;
    }
  }
  Map parts(changes.header());
  MapSink part_sink(parts);
  copy(changes, types, part_sink, false);
  for (const auto& [key, patch] : parts.by_key()) {
    for (const auto& [id, layer] : patch.layers) out.patch(patch.index).layers[id] = layer;
  }
  out.prune();
  return out;
}

void expect_sorted(const std::vector<MapChanges::Gone>& gone) {
  for (std::size_t i = 1; i < gone.size(); ++i) {
    const auto a = curve_key(gone[i - 1].patch), b = curve_key(gone[i].patch);
    EXPECT_TRUE(a < b || (a == b && gone[i - 1].layer < gone[i].layer));
  }
}

/// The summary is what the walk gives.
void expect_summed_up(const ChangesSource& changes) {
  const Summary said = changes.summary();
  Summary found;
  found.types.resize(changes.header().types.size());
  PatchInfo patch;
  for (const auto cursor = changes.patches(); cursor->next(patch);) {
    ++found.patches;
    found.range.add(patch.patch);
    EXPECT_FALSE(patch.layers.empty());
    for (const LayerInfo& info : patch.layers) {
      Summary::OfType& totals = found.types[info.type];
      ++totals.layers;
      ++totals.layers_at[info.step];
      totals.stored_bytes += info.stored_bytes;
      totals.raw_bytes +=
          (std::uint64_t{4} << (2 * info.step)) * changes.header().types[info.type].channels.size();
    }
  }
  EXPECT_EQ(said.patches, found.patches);
  EXPECT_EQ(said.range, found.range);
  EXPECT_EQ(said.types, found.types);
  EXPECT_EQ(changes.empty(), found.patches == 0 && changes.gone().empty());
}

TEST(ChangesSource, BringsOneRandomMapToAnother) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    const Map base = random_map(seed), other = edited_map(base, seed + 1000);
    const ChangesSource changes(base, other);
    EXPECT_EQ(difference(changed(base, changes), other, true), "");
    expect_sorted(changes.gone());
    expect_summed_up(changes);
  }
}

TEST(ChangesSource, IsTheSameFromIndexesAsFromCells) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    const Map base = random_map(seed), other = edited_map(base, seed + 1000);
    const auto base_bytes = to_bytes(base), other_bytes = to_bytes(other, at_level(1));
    const Reader base_reader(base_bytes), other_reader(other_bytes);
    const WatchedSource counted_base(base_reader), counted_other(other_reader);
    const ChangesSource by_cells(base, other), by_hash(counted_base, counted_other),
        mixed(base, other_reader);
    EXPECT_EQ(counted_base.loads + counted_other.loads, 0);
    for (const ChangesSource* changes : {&by_hash, &mixed}) {
      EXPECT_EQ(changes->gone(), by_cells.gone());
      EXPECT_EQ(difference(changed(base, *changes), other, true), "");
      EXPECT_EQ(changes->summary().patches, by_cells.summary().patches);
      expect_summed_up(*changes);
    }
  }
}

TEST(ChangesSource, IsEmptyForARecompressedCopy) {
  const Map map = random_map(7);
  const auto fast = to_bytes(map, at_level(1)), small = to_bytes(map, at_level(19));
  const Reader a(fast), b(small);
  EXPECT_TRUE(ChangesSource(a, b).empty());
  EXPECT_TRUE(ChangesSource(map, b).empty());
  EXPECT_TRUE(ChangesSource(map, map).empty());
}

TEST(ChangesSource, FindsStampsAlone) {
  const Map base = random_map(8);
  Map other = base;
  const PatchIndex at = base.by_key().begin()->second.index;
  const TypeId type = base.by_key().begin()->second.layers.begin()->first;
  ++other.patch(at).layers[type].stamp_ns;
  const auto bytes = to_bytes(base), other_bytes = to_bytes(other);
  const Reader a(bytes), b(other_bytes);
  EXPECT_EQ(a.content_id(), b.content_id());
  const ChangesSource by_cells(base, other), by_hash(a, b);
  for (const ChangesSource* changes : {&by_cells, &by_hash}) {
    EXPECT_TRUE(changes->gone().empty());
    EXPECT_EQ(changes->summary().patches, 1u);
    EXPECT_EQ(changes->summary().types[type].layers, 1u);
  }
}

TEST(ChangesSource, EverythingMayComeAndGo) {
  const Map full = random_map(9), empty(full.header());
  const ChangesSource gone(full, empty), come(empty, full);
  std::size_t layers = 0;
  for (const auto& [key, patch] : full.by_key()) layers += patch.layers.size();
  EXPECT_EQ(gone.gone().size(), layers);
  EXPECT_EQ(gone.summary().patches, 0u);
  EXPECT_FALSE(gone.empty());
  EXPECT_TRUE(come.gone().empty());
  EXPECT_EQ(come.summary().patches, full.size());
  EXPECT_TRUE(ChangesSource(empty, empty).empty());
}

TEST(ChangesSource, ATypeOfAnotherSpaceIsChangedNotGone) {
  MapHeader header;
  header.types = TypeTable({LayerType::semantic("s", {"a", "b"})});
  Map base(header);
  header.types = TypeTable({LayerType::semantic("s", {"a", "c"})});
  Map other(header);
  for (Map* map : {&base, &other}) {
    Layer& layer = map->layer({0, 0}, 0, 0);
    layer.plane(0)[0] = 1;
    layer.plane(2)[0] = 0;
  }
  const ChangesSource changes(base, other);
  EXPECT_TRUE(changes.gone().empty());
  EXPECT_EQ(changes.summary().patches, 1u);
}

TEST(ChangesSource, ALayerWithoutDataIsGone) {
  const Map base = random_map(10);
  Map other = base;
  const auto& patch = base.by_key().begin()->second;
  const TypeId type = patch.layers.begin()->first;
  other.patch(patch.index).layers[type].reset(base.header().types[type], 2);
  const ChangesSource changes(base, other);
  ASSERT_EQ(changes.gone().size(), 1u);
  EXPECT_EQ(changes.gone()[0], (MapChanges::Gone{patch.index, base.header().types[type].name}));
  EXPECT_EQ(changes.summary().patches, 0u);
}

TEST(ChangesSource, KeepsToARange) {
  const PatchRange range{{-1, -2}, {1, 0}};
  std::size_t found = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    SCOPED_TRACE(seed);
    const Map base = random_map(seed), other = edited_map(base, seed + 1000);
    const ChangesSource changes(base, other);
    std::vector<LayerInfo> all, within;
    PatchInfo patch;
    for (const auto cursor = changes.patches(); cursor->next(patch);) {
      if (range.contains(patch.patch)) all.insert(all.end(), patch.layers.begin(), patch.layers.end());
    }
    for (const auto cursor = changes.patches(range); cursor->next(patch);) {
      within.insert(within.end(), patch.layers.begin(), patch.layers.end());
    }
    const auto place = [](const LayerInfo& info) { return std::pair(info.patch, info.type); };
    EXPECT_TRUE(std::ranges::equal(all, within, {}, place, place));
    found += all.size();
  }
  EXPECT_GT(found, 10u);
}

TEST(ChangesSource, RefusesAnotherFrameAndStopsWhenAsked) {
  const Map base = random_map(13);
  test::RandomMapOptions options;
  options.frame.datum_x_um = 1;
  const Map shifted = random_map(13, options);
  try {
    const ChangesSource changes(base, shifted, {}, {"a.apgm", "b.apgm"});
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kIncompatible);
    EXPECT_EQ(e.message(),
              "'b.apgm' has another frame than 'a.apgm': datums differ (0.000001,0 m and 0,0 m)");
    EXPECT_FALSE(e.hint().empty());
  }
  const std::atomic<bool> cancel{true};
  RunOptions run;
  run.cancel = &cancel;
  EXPECT_THROW(ChangesSource(base, base, run), Error);
}

TEST(ChangesSource, SaysWhatTheSourceOfItsLayersTakes) {
  const Map base = random_map(1), other = edited_map(base, 2);
  const WatchedSource watched_base(base), watched_other(other);
  EXPECT_EQ(ChangesSource(base, watched_other).working_bytes(100), 300u);
  EXPECT_EQ(ChangesSource(watched_base, other).working_bytes(100), 0u);
}

}  // namespace
}  // namespace apgm

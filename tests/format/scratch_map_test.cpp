#include "apgm/format/scratch_map.hpp"

#include <sys/resource.h>

#include <csignal>
#include <filesystem>

#include <gmock/gmock.h>

#include "apgm/core/error.hpp"
#include "random_map.hpp"
#include "sample_map.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

using test::difference;
using test::random_map;
using test::TempDir;

Map to_map(const PatchSource& source) {
  Map map(source.header());
  MapSink sink(map);
  test::stream(source, sink);
  return map;
}

/// Passes stored bytes on, as ops::copy does.
void stream_stored(const PatchSource& source, PatchSink& sink) {
  const auto cursor = source.patches();
  PatchInfo patch;
  while (cursor->next(patch)) {
    std::vector<Parcel> parcels(patch.layers.size());
    for (std::size_t i = 0; i < parcels.size(); ++i) {
      parcels[i].patch = patch.patch;
      parcels[i].type = patch.layers[i].type;
      parcels[i].stamp_ns = patch.layers[i].stamp_ns;
      parcels[i].state = Parcel::State::kStored;
      ASSERT_TRUE(source.load_stored(patch.layers[i], parcels[i].stored));
    }
    sink.put(patch.patch, parcels);
  }
  sink.finish();
}

/// Moves random patches between a map in memory and the store; what is in neither hand is in `all`.
void play(std::uint64_t seed, int steps, ScratchMap& scratch, Map& all) {
  test::Random random(seed);
  for (int i = 0; i < steps; ++i) {
    const Map source = random_map(random.next() % 50);
    auto it = source.by_key().begin();
    std::advance(it, random.below(static_cast<int>(source.size())));
    Patch taken;
    if (random.chance(0.3)) {
      const PatchIndex index = it->second.index;
      const Patch* known = all.find(index);
      ASSERT_EQ(scratch.take(index, taken), known != nullptr);
      if (known == nullptr) continue;
      ASSERT_EQ(taken.index, index);
      ASSERT_EQ(taken.layers.size(), known->layers.size());
      for (const auto& [type, layer] : known->layers) {
        ASSERT_TRUE(same_cells(layer, taken.layers.at(type)));
        ASSERT_EQ(layer.stamp_ns, taken.layers.at(type).stamp_ns);
      }
      for (const auto& [type, layer] : taken.layers) all.extract(index, type);
      ASSERT_FALSE(scratch.take(index, taken));
    } else {
      scratch.store(it->second);
      all.patch(it->second.index) = it->second;
    }
  }
}

TEST(ScratchMapTest, HoldsWhatRandomHistoriesLeaveInIt) {
  TempDir dir;
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    ScratchMap scratch(random_map(0).header(), dir.path());
    Map all(scratch.header());
    ASSERT_NO_FATAL_FAILURE(play(seed, 300, scratch, all));
    EXPECT_EQ(difference(to_map(scratch), all, true), "");
    const Summary a = scratch.summary(), b = all.summary();
    EXPECT_EQ(a.patches, b.patches);
    EXPECT_EQ(a.range, b.range);
    for (std::size_t t = 0; t < a.types.size(); ++t) {
      EXPECT_EQ(a.types[t].layers_at, b.types[t].layers_at);
      EXPECT_EQ(a.types[t].raw_bytes, b.types[t].raw_bytes);
    }
  }
}

TEST(ScratchMapTest, GivesAWriterTheBytesThatTheMapItselfGives) {
  TempDir dir;
  ScratchMap scratch(random_map(0).header(), dir.path());
  Map all(scratch.header());
  ASSERT_NO_FATAL_FAILURE(play(77, 300, scratch, all));
  Writer stored(dir / "stored.apgm", scratch.header());
  ASSERT_NO_FATAL_FAILURE(stream_stored(scratch, stored));
  test::write_map(all, dir / "direct.apgm");
  EXPECT_EQ(test::read_file(dir / "stored.apgm"), test::read_file(dir / "direct.apgm"));
}

TEST(ScratchMapTest, SpaceOfReplacedAndTakenPatchesIsUsedAgain) {
  TempDir dir;
  ScratchMap scratch(test::sample_map(1).header(), dir.path());
  const Map map = test::sample_map(1, 60, 8);
  std::uint64_t live = 0, most = 0;
  for (int round = 0; round < 40; ++round) {
    for (const auto& [key, patch] : map.by_key()) {
      scratch.store(patch);
      most = std::max(most, scratch.file_bytes());
    }
    const Summary summary = scratch.summary();
    live = 0;
    for (const auto& t : summary.types) live += t.stored_bytes;
  }
  EXPECT_GT(live, std::uint64_t{300'000});
  EXPECT_LT(most, 2 * std::max<std::uint64_t>(live, 1 << 20) + live);
  EXPECT_EQ(difference(to_map(scratch), map, true), "");
  Patch out;
  for (const auto& [key, patch] : map.by_key()) ASSERT_TRUE(scratch.take(patch.index, out));
  EXPECT_EQ(scratch.file_bytes(), 0u);
}

TEST(ScratchMapTest, LeavesNothingToSee) {
  TempDir dir;
  ScratchMap scratch(random_map(0).header(), dir.path());
  const Map map = random_map(5);
  for (const auto& [key, patch] : map.by_key()) scratch.store(patch);
  EXPECT_THAT(dir.list(), testing::IsEmpty());
}

TEST(ScratchMapTest, CursorKeepsToItsRange) {
  TempDir dir;
  const Map map = random_map(9);
  ScratchMap scratch(map.header(), dir.path());
  for (const auto& [key, patch] : map.by_key()) scratch.store(patch);
  const PatchRange range{{-1, -2}, {1, 0}};
  const auto a = scratch.patches(range), b = map.patches(range);
  PatchInfo from_scratch, from_map;
  while (b->next(from_map)) {
    ASSERT_TRUE(a->next(from_scratch));
    EXPECT_EQ(from_scratch.patch, from_map.patch);
    EXPECT_EQ(from_scratch.layers.size(), from_map.layers.size());
  }
  EXPECT_FALSE(a->next(from_scratch));
}

TEST(ScratchMapTest, LayersFollowTheNamesOfTheirTypes) {
  TempDir dir;
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy("m"), LayerType::occupancy("unused")});
  ScratchMap scratch(header, dir.path());
  Patch patch;
  patch.index = {3, 4};
  patch.layers[0].reset(header.types[0], 1);
  patch.layers[0].plane(0)[2] = 0.5f;
  scratch.store(patch);
  scratch.set_types(TypeTable({LayerType::occupancy("a"), LayerType::occupancy("m")}));
  Patch out;
  ASSERT_TRUE(scratch.take({3, 4}, out));
  ASSERT_EQ(out.layers.size(), 1u);
  EXPECT_EQ(out.layers.at(1).plane(0)[2], 0.5f);
  scratch.store(out);
  EXPECT_THROW(scratch.set_types(TypeTable({LayerType::occupancy("a")})), Error);
  EXPECT_THROW(scratch.set_types(TypeTable({LayerType::semantic("m", {"x", "y"})})), Error);
  header.frame.edge_um = 10'000'000;
  EXPECT_THROW(scratch.set_header(header), Error);
  EXPECT_TRUE(scratch.take({3, 4}, out));
}

TEST(ScratchMapTest, VacuousLayersAreLeftOutAndBadMassesRefused) {
  TempDir dir;
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  ScratchMap scratch(header, dir.path());
  Patch good, vacuous, bad;
  for (Patch* p : {&good, &vacuous, &bad}) p->layers[0].reset(header.types[0], 2);
  good.layers[0].plane(0)[0] = 0.5f;
  bad.layers[0].plane(0)[0] = 1.5f;
  scratch.store(good);
  EXPECT_THROW(scratch.store(bad), Error);
  EXPECT_EQ(scratch.summary().patches, 1u);
  scratch.store(vacuous);
  EXPECT_EQ(scratch.summary().patches, 0u);
  EXPECT_EQ(scratch.file_bytes(), 0u);
}

TEST(ScratchMapTest, AFullDiskIsAnOutputErrorAndLosesNothing) {
  TempDir dir;
  const Map map = test::sample_map(1, 60, 8);
  ScratchMap scratch(map.header(), dir.path());
  Map kept(map.header());
  rlimit old{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &old), 0);
  const rlimit small{100'000, old.rlim_max};
  ASSERT_NE(std::signal(SIGXFSZ, SIG_IGN), SIG_ERR);
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  std::optional<ErrorCode> code;
  for (const auto& [key, patch] : map.by_key()) {
    try {
      scratch.store(patch);
      kept.patch(patch.index) = patch;
    } catch (const Error& e) {
      code = e.code();
    }
  }
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &old), 0);
  EXPECT_EQ(code, ErrorCode::kOutput);
  EXPECT_GT(kept.size(), 0u);
  EXPECT_EQ(difference(to_map(scratch), kept, true), "");
}

TEST(ScratchMapTest, DeadSpaceThatCannotBeReclaimedIsNoError) {
  TempDir dir;
  const Map map = test::sample_map(1, 60, 8);
  ScratchMap scratch(map.header(), dir.path());
  const auto store_all = [&] {
    for (const auto& [key, patch] : map.by_key()) scratch.store(patch);
  };
  store_all();
  const std::uint64_t live = scratch.file_bytes();
  // Nowhere to make the file to move to. (Without descriptors UBSan's own checks fail.)
  ASSERT_TRUE(std::filesystem::remove(dir.path()));
  for (int round = 0; round < 12; ++round) store_all();
  ASSERT_TRUE(std::filesystem::create_directory(dir.path()));
  EXPECT_EQ(scratch.file_bytes(), 13 * live);
  EXPECT_EQ(difference(to_map(scratch), map, true), "");
  for (int round = 0; round < 40; ++round) store_all();
  EXPECT_LT(scratch.file_bytes(), 3 * std::max<std::uint64_t>(live, 1 << 20));
  EXPECT_EQ(difference(to_map(scratch), map, true), "");
}

TEST(ScratchMapTest, ADirectoryThatIsNotThereIsAnOutputError) {
  TempDir dir;
  try {
    ScratchMap scratch(random_map(0).header(), dir / "missing");
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kOutput);
    EXPECT_THAT(e.what(), testing::HasSubstr("missing"));
  }
}

}  // namespace
}  // namespace apgm

#include <gmock/gmock.h>

#include <functional>

#include "apgm/core/budget.hpp"
#include "apgm/core/error.hpp"
#include "apgm/format/message.hpp"
#include "apgm/format/scratch_map.hpp"
#include "apgm/observe/mapper.hpp"
#include "drives.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

using test::coarse_options;
using test::difference;
using test::disc;
using test::drive;
using test::DriveOptions;
using test::kSecond;
using test::MemoryStore;
using test::parking;
using test::road;
using test::TempDir;

Map to_map(const PatchSource& source) {
  Map map(source.header());
  const auto cursor = source.patches();
  PatchInfo patch;
  while (cursor->next(patch)) {
    for (const LayerInfo& info : patch.layers) source.load(info, map.patch(info.patch).layers[info.type]);
  }
  return map;
}

TEST(MapperStoreTest, TheFinalMapDoesNotDependOnTheMemory) {
  TempDir dir;
  for (const bool profiles : {false, true}) {
    for (const double ageing : {1.0, 0.7}) {
      for (std::uint64_t seed = 0; seed < 6; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed) + " ageing " + std::to_string(ageing));
        std::optional<Map> expected;
        // What a profile requires must fit.
        const std::uint64_t least = profiles ? 150'000 : 0;
        for (const std::uint64_t memory : {0, 1, 20'000, 100'000}) {
          MapperOptions options = coarse_options();
          options.ageing_per_s = ageing;
          options.max_memory_bytes = memory == 0 ? 0 : least + memory;
          MapHeader header;
          ScratchMap scratch(header, dir.path());
          Mapper mapper(header.frame, Models{}, options, &scratch);
          int calls = 0;
          drive(mapper, seed, {60, profiles, true}, [&] {
            if (++calls % 17 == 0) mapper.flush();
            if (memory == 0) return;
            std::uint64_t bytes = 0;
            for (const auto& t : mapper.map().summary().types) bytes += t.raw_bytes;
            ASSERT_LE(bytes, options.max_memory_bytes);
          });
          mapper.flush();
          EXPECT_EQ(mapper.map().size(), 0u);
          const Map all = to_map(scratch);
          EXPECT_GT(all.size(), 0u);
          if (!expected) {
            expected = all;
          } else {
            ASSERT_EQ(difference(*expected, all, true), "") << memory;
          }
        }
      }
    }
  }
}

TEST(MapperStoreTest, TheSameCallsGiveTheSameMapWithAStoreInMemory) {
  TempDir dir;
  MapperOptions options = coarse_options();
  options.ageing_per_s = 0.8;
  options.max_memory_bytes = 150'000;
  ScratchMap scratch(MapHeader{}, dir.path());
  MemoryStore memory{Frame{}};
  Mapper a(Frame{}, Models{}, options, &scratch), b(Frame{}, Models{}, options, &memory);
  for (Mapper* mapper : {&a, &b}) {
    drive(*mapper, 99, {120}, [] {});
    mapper->flush();
  }
  EXPECT_EQ(difference(to_map(scratch), memory.map, true), "");
}

TEST(MapperStoreTest, ChangesReproduceTheMapAtEveryLook) {
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    MapperOptions options = coarse_options();
    options.ageing_per_s = seed % 2 == 0 ? 1.0 : 0.5;
    options.max_memory_bytes = seed % 3 == 0 ? 150'000 : 0;
    MemoryStore store{Frame{}};
    Mapper mapper(Frame{}, Models{}, options, &store);
    Map copy(mapper.map().header());
    test::Random random(seed);
    std::size_t gone = 0;
    drive(mapper, seed, {80}, [&] {
      if (random.chance(0.4)) return;
      const MapChanges changes = changes_from_bytes(to_bytes(mapper.take_changes()));
      gone += changes.gone.size();
      apply(changes, copy);
      ASSERT_EQ(difference(copy, mapper.map(), true), "");
      ASSERT_EQ(copy.header().types, mapper.map().header().types);
      const MapChanges none = mapper.take_changes();
      ASSERT_EQ(none.changed.size(), 0u);
      ASSERT_TRUE(none.gone.empty());
    });
    EXPECT_GT(gone, 0u);
  }
}

TEST(MapperStoreTest, ChangesAreOnlyWhatChanged) {
  Mapper mapper(Frame{}, Models{}, coarse_options());
  test::Random random(1);
  mapper.add(test::random_scan(random, {0, 0}, 0));
  mapper.take_changes();
  mapper.add(test::random_scan(random, {200, 200}, 1));
  const MapChanges changes = mapper.take_changes();
  EXPECT_GT(changes.changed.size(), 0u);
  EXPECT_LT(changes.changed.size(), mapper.map().size());
}

/// The layers of one type with their steps.
std::map<PatchIndex, int> steps_of(const Map& map, const std::string& name) {
  std::map<PatchIndex, int> steps;
  const TypeId type = *map.header().types.find(name);
  for (const auto& [key, patch] : map.by_key()) {
    const auto it = patch.layers.find(type);
    if (it != patch.layers.end()) steps[patch.index] = it->second.step();
  }
  return steps;
}

TEST(MapperStoreTest, AnotherProfileHoldsWithinOneStepAndLosesNothingItWants) {
  MemoryStore store{Frame{}};
  Mapper mapper(Frame{}, Models{}, coarse_options(), &store);
  mapper.set_profile(road());
  mapper.move_to({0, 0}, 0);
  test::Random random(5);
  for (int i = 0; i < 30; ++i) {
    mapper.add(test::random_scan(random, {0, 0}, i));
    mapper.add(test::random_image(random, {0, 0}, i));
  }
  const Map wide = mapper.map();
  const auto wide_steps = steps_of(wide, "occupancy");
  const Frame& frame = wide.header().frame;
  for (const auto& [patch, step] : wide_steps) {
    EXPECT_EQ(ProfileInFrame(road(), frame).required_step(patch, "occupancy", {0, 0}), step);
  }

  mapper.set_profile(parking());
  EXPECT_EQ(difference(mapper.map(), wide), "") << "holds from the next call on";
  const MapperReport report = mapper.move_to({0, 0}, 100);
  EXPECT_GT(report.patches_dropped, 0u);
  std::size_t wanted = 0;
  for (const auto& [patch, step] : wide_steps) {
    const auto required = ProfileInFrame(parking(), frame).required_step(patch, "occupancy", {0, 0});
    const auto steps = steps_of(mapper.map(), "occupancy");
    ASSERT_EQ(steps.contains(patch), required.has_value());
    if (!required) continue;
    ++wanted;
    ASSERT_EQ(steps.at(patch), *required);
    ASSERT_EQ(steps.at(patch), 5);
    ASSERT_EQ(step, 4);
    // No evidence for an obstacle is lost: the sum of lambda is the same.
    const TypeId type = *wide.header().types.find("occupancy");
    double before = 0, after = 0;
    for (const float m : wide.find(patch, type)->plane(0)) before -= std::log1p(-static_cast<double>(m));
    for (const float m : mapper.map().find(patch, type)->plane(0))
      after -= std::log1p(-static_cast<double>(m));
    ASSERT_NEAR(after, before, 1e-4 * before + 1e-6);
  }
  EXPECT_GT(wanted, 0u);
  EXPECT_TRUE(steps_of(mapper.map(), "semantics").empty());

  // What left lies in the store as it was, and comes back when it is wanted again.
  mapper.set_profile(road());
  mapper.move_to({0, 0}, 200);
  EXPECT_EQ(steps_of(mapper.map(), "occupancy"), wide_steps);
  EXPECT_EQ(store.map.size(), 0u);
  const TypeId semantics = *wide.header().types.find("semantics");
  for (const auto& [patch, step] : steps_of(wide, "semantics")) {
    ASSERT_NE(mapper.map().find(patch, semantics), nullptr);
    EXPECT_TRUE(same_cells(*mapper.map().find(patch, semantics), *wide.find(patch, semantics)));
  }
}

TEST(MapperStoreTest, LayersOfAPatchMayLeaveAndComeBackAtDifferentTimes) {
  MemoryStore store{Frame{}};
  Mapper mapper(Frame{}, Models{}, coarse_options(), &store);
  test::Random random(8);
  mapper.move_to({6, 6}, 0);
  mapper.add(test::random_scan(random, {6, 6}, 0));
  mapper.add(test::random_image(random, {6, 6}, 0));
  const Map all = mapper.map();
  ASSERT_EQ(all.find({0, 0})->layers.size(), 2u);

  const auto switch_to = [&](Profile profile) {
    mapper.set_profile(std::move(profile));
    mapper.move_to({6, 6}, 0);
  };
  switch_to({"", {disc("semantics", 100, 0.8)}});
  EXPECT_EQ(mapper.map().find({0, 0})->layers.size(), 1u);
  EXPECT_EQ(store.map.find({0, 0})->layers.size(), 1u);
  switch_to({"", {disc("occupancy", 0.1, 0.8)}});
  EXPECT_EQ(mapper.map().size(), 1u);
  EXPECT_EQ(store.map.find({0, 0})->layers.size(), 1u);
  switch_to({"", {{"semantics", 0.8, Ring{5000, 5001}}}});
  EXPECT_EQ(mapper.map().size(), 0u);
  EXPECT_EQ(store.map.find({0, 0})->layers.size(), 2u);
  switch_to({"", {disc("semantics", 100, 0.8), disc("occupancy", 100, 0.8)}});
  EXPECT_EQ(difference(mapper.map(), all, true), "");
  EXPECT_EQ(store.map.size(), 0u);
}

TEST(MapperStoreTest, AStoredLayerComesBackAtTheStepThatIsWantedThen) {
  MemoryStore store{Frame{}};
  Mapper mapper(Frame{}, Models{}, coarse_options(), &store);
  test::Random random(8);
  mapper.move_to({0, 0}, 0);
  mapper.add(test::random_scan(random, {0, 0}, 0));
  mapper.set_profile(Profile{"", {disc("occupancy", 1, 0.8)}});
  mapper.move_to({5000, 0}, 1);
  EXPECT_EQ(mapper.map().size(), 0u);
  mapper.set_profile(Profile{"", {disc("occupancy", 100, 3.2)}});
  const MapperReport report = mapper.move_to({0, 0}, 2);
  EXPECT_GT(report.layers_resampled, 0u);
  for (const auto& [patch, step] : steps_of(mapper.map(), "occupancy")) EXPECT_EQ(step, 2);
}

TEST(MapperStoreTest, WithoutAStoreWhatLeavesIsGone) {
  Mapper mapper(Frame{}, Models{}, coarse_options());
  test::Random random(8);
  mapper.add(test::random_scan(random, {0, 0}, 0));
  mapper.set_profile(parking());
  mapper.move_to({5000, 0}, 1);
  mapper.move_to({0, 0}, 2);
  EXPECT_EQ(mapper.map().size(), 0u);
}

TEST(MapperStoreTest, AStoreThatFailsLosesNothing) {
  MemoryStore store{Frame{}};
  Mapper mapper(Frame{}, Models{}, coarse_options(), &store);
  test::Random random(8);
  mapper.add(test::random_scan(random, {0, 0}, 0));
  const Map before = mapper.map();
  store.fails = true;
  EXPECT_THROW(mapper.flush(), std::runtime_error);
  EXPECT_EQ(difference(mapper.map(), before, true), "");
  mapper.set_profile(parking());
  EXPECT_THROW(mapper.move_to({5000, 0}, 1), std::runtime_error);
  EXPECT_EQ(difference(mapper.map(), before, true), "");
  store.fails = false;
  mapper.move_to({5000, 0}, 2);
  EXPECT_EQ(difference(store.map, before, true), "");
}

std::uint64_t bytes_of(const Map& map) {
  std::uint64_t bytes = 0;
  for (const auto& t : map.summary().types) bytes += t.raw_bytes;
  return bytes;
}

std::optional<ErrorCode> code_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& e) {
    return e.code();
  }
  return {};
}

TEST(MapperStoreTest, ALayerThatCannotBeBroughtToItsStepLosesNoOther) {
  // The step is too fine for the layer; a profile that was checked does not ask for that, so the memory is
  // what fails here.
  MemoryStore store{Frame{}};
  MapperOptions options = coarse_options();
  options.max_memory_bytes = 1'000'000;
  Mapper mapper(Frame{}, Models{}, options, &store);
  test::Random random(8);
  mapper.move_to({6, 6}, 0);
  mapper.add(test::random_scan(random, {6, 6}, 0));
  mapper.add(test::random_image(random, {6, 6}, 0));
  const Map all = mapper.map();
  ASSERT_EQ(all.find({0, 0})->layers.size(), 2u);
  mapper.flush();
  const auto total = [&] {
    Map both = store.map;
    for (const auto& [key, patch] : mapper.map().by_key()) {
      for (const auto& [type, layer] : patch.layers) both.patch(patch.index).layers[type] = layer;
    }
    return both;
  };
  mapper.set_profile(Profile{"too fine", {disc("occupancy", 100, 0.8), disc("semantics", 100, 0.0125)}});
  for (int i = 1; i < 4; ++i) {
    EXPECT_EQ(code_of([&] { mapper.move_to({6, 6}, i); }), ErrorCode::kLimit);
    EXPECT_EQ(difference(total(), all, true), "");
  }
  EXPECT_THAT(
      [&] {
        mapper.move_to({6, 6}, 9);
      },
      testing::Throws<Error>(testing::Property(&Error::message, testing::HasSubstr("'too fine'"))));
  EXPECT_EQ(code_of([&] { mapper.add(test::random_scan(random, {6, 6}, 5)); }), ErrorCode::kLimit);
  mapper.set_profile(Profile{"", {disc("occupancy", 100, 0.8), disc("semantics", 100, 0.8)}});
  mapper.move_to({6, 6}, 10);
  EXPECT_EQ(difference(mapper.map(), all, true), "");
  EXPECT_EQ(store.map.size(), 0u);
}

TEST(MapperStoreTest, NoProfileAsksForLayersThatCannotBe) {
  Models models;
  models.classes = {"a", "b", "c", "d", "e"};
  Mapper mapper(Frame{}, models, coarse_options());
  EXPECT_EQ(code_of([&] {
              mapper.set_profile(Profile{"", {disc("semantics", 10, 12.8 / 2048)}});
            }),
            ErrorCode::kInvalidArgument);
}

TEST(MapperStoreTest, WhatAProfileRequiresMustFitWhileItIsObserved) {
  MemoryStore store{Frame{}};
  MapperOptions options = coarse_options();
  options.max_memory_bytes = 10'000;
  Mapper mapper(Frame{}, Models{}, options, &store);
  mapper.set_profile(road());
  mapper.move_to({0, 0}, 0);
  test::Random random(3);
  EXPECT_EQ(code_of([&] {
              for (int i = 0; i < 20; ++i) mapper.add(test::random_scan(random, {0, 0}, i));
            }),
            ErrorCode::kLimit);
  EXPECT_GT(mapper.map().size(), 0u);
  EXPECT_LE(bytes_of(mapper.map()), options.max_memory_bytes);
  mapper.set_profile(std::nullopt);
  EXPECT_NO_THROW(mapper.add(test::random_scan(random, {0, 0}, 30)));
}

/// A store that looks how large the map is whenever it is given something.
class WatchingStore final : public PatchStore {
 public:
  void set_types(const TypeTable& types) override { store_.set_types(types); }
  void store(const Patch& patch) override {
    if (mapper != nullptr) most = std::max(most, bytes_of(mapper->map()));
    store_.store(patch);
  }
  bool take(PatchIndex index, Patch& out) override { return store_.take(index, out); }
  const Mapper* mapper = nullptr;
  std::uint64_t most = 0;

 private:
  MemoryStore store_{Frame{}};
};

TEST(MapperStoreTest, MemoryIsBoundedDuringACallToo) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map wide(header);
  for (std::int32_t i = 0; i < 400; ++i) wide.layer({i % 20, i / 20}, 0, 4).plane(0)[0] = 0.5f;
  WatchingStore store;
  MapperOptions options = coarse_options();
  options.max_memory_bytes = 50'000;
  Mapper mapper(Frame{}, Models{}, options, &store);
  store.mapper = &mapper;
  for (int i = 0; i < 3; ++i) mapper.add(wide);
  EXPECT_GT(store.most, options.max_memory_bytes / 2);
  EXPECT_LE(store.most, options.max_memory_bytes + 2048);
}

TEST(MapperStoreTest, OneMeasurementIsBounded) {
  MemoryStore store{Frame{}};
  MapperOptions options;
  options.cell_m = 0.0125;  // 8 MiB a patch
  options.max_memory_bytes = 1'000'000;
  Mapper mapper(Frame{}, Models{}, options, &store);
  RangeScan scan;
  scan.beams.push_back({{0, 0}, {300, 0}, true});
  EXPECT_EQ(code_of([&] { mapper.add(scan); }), ErrorCode::kLimit);
  EXPECT_EQ(mapper.map().size() + store.map.size(), 0u);
  scan.beams[0].to = {20, 1};
  EXPECT_NO_THROW(mapper.add(scan));
  mapper.flush();
  EXPECT_EQ(store.map.size(), 2u);
}

TEST(MapperStoreTest, AMeasurementThatDoesNotFitTellsWhatItNeeds) {
  MemoryStore store{Frame{}};
  MapperOptions options;
  options.cell_m = 0.0125;  // 8 MiB a patch
  options.max_memory_bytes = 1'000'000;
  options.max_measurement_bytes = std::uint64_t{16} << 20;
  RangeScan scan;
  scan.beams.push_back({{1, 1}, {12.8 * 4 + 1, 1}, true});  // 5 patches
  {
    Mapper mapper(Frame{}, Models{}, options, &store);
    const Error error = [&] {
      try {
        mapper.add(scan);
      } catch (const Error& e) {
        return e;
      }
      return Error(ErrorCode::kCancelled, "nothing was thrown");
    }();
    const auto hint = budget_hint(error);
    ASSERT_TRUE(hint) << error.message();
    EXPECT_EQ(hint->least_mebibytes, 40u);
    EXPECT_EQ(mapper.map().size() + store.map.size(), 0u);
    options.max_measurement_bytes = hint->least_mebibytes << 20;
  }
  Mapper mapper(Frame{}, Models{}, options, &store);
  EXPECT_NO_THROW(mapper.add(scan));
}

TEST(MapperStoreTest, AWrongProfileLeavesTheOldOne) {
  Mapper mapper(Frame{}, Models{}, coarse_options());
  mapper.set_profile(parking());
  mapper.move_to({0, 0}, 0);
  EXPECT_THROW(mapper.set_profile(Profile{"", {disc("no_such_layer", 10, 0.4)}}), Error);
  EXPECT_THROW(mapper.set_profile(Profile{"", {disc("occupancy", 10, 0.3)}}), Error);
  test::Random random(8);
  mapper.add(test::random_scan(random, {0, 0}, 1));
  for (const auto& [patch, step] : steps_of(mapper.map(), "occupancy")) EXPECT_EQ(step, 5);
}

}  // namespace
}  // namespace apgm

#include "apgm/ops/apply.hpp"

#include <gtest/gtest.h>

#include "apgm/format/content_id.hpp"
#include "apgm/format/message.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/format/writer.hpp"
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
using Bytes = std::vector<std::byte>;

/// What a Writer makes of a source, all stored bytes passed on.
Bytes written(const PatchSource& source, const MapHeader& header, int threads = 1) {
  Bytes bytes;
  Writer writer(bytes, header);
  RunOptions run;
  run.threads = threads;
  copy(source, header.types, writer, false, run);
  writer.finish();
  return bytes;
}

Bytes delta_of(const PatchSource& base, const PatchSource& other) {
  const ChangesSource changes(base, other);
  return written(changes, delta_header(changes, content_id_of(base), content_id_of(other)));
}

Bytes applied(const PatchSource& base, const PatchSource& delta, int threads = 1) {
  const AppliedSource source(base, delta);
  return written(source, source.header(), threads);
}

/// Runs `work`, which fails. @return its error
template <typename Work>
Error failure(Work work) {
  try {
    work();
  } catch (const Error& e) {
    return e;
  }
  ADD_FAILURE() << "nothing was thrown";
  return {ErrorCode::kCancelled, ""};
}

Error refusal(const PatchSource& base, const PatchSource& delta) {
  return failure([&] { AppliedSource(base, delta); });
}

/// The delta with other metadata, cells as they are.
Bytes relabelled(const Bytes& delta, const std::function<void(std::map<std::string, std::string>&)>& edit) {
  const Reader reader(delta);
  MapHeader header = reader.header();
  edit(header.metadata);
  return written(reader, header);
}

/// apply(diff(base, other), base) is the file of other, byte for byte.
void expect_round_trip(const Map& base, const Map& other) {
  const Bytes base_bytes = to_bytes(base), other_bytes = to_bytes(other);
  const Reader base_reader(base_bytes), other_reader(other_bytes);
  const Bytes delta_bytes = delta_of(base_reader, other_reader);
  EXPECT_EQ(delta_bytes, delta_of(base, other));
  const Reader delta(delta_bytes);
  EXPECT_TRUE(holds_changes(delta.header()));
  EXPECT_EQ(applied(base_reader, delta), other_bytes);
  EXPECT_EQ(applied(base_reader, delta, 3), other_bytes);
  const AppliedSource view(base_reader, delta);
  EXPECT_EQ(view.content_id(), other_reader.content_id());
  EXPECT_FALSE(holds_changes(view.header()));
  const Summary said = view.summary(), is = other_reader.summary();
  EXPECT_EQ(said.patches, is.patches);
  EXPECT_EQ(said.range, is.range);
  EXPECT_EQ(said.types, is.types);
}

TEST(AppliedSource, OfADeltaIsTheOtherRandomMapByteForByte) {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE(seed);
    const Map base = random_map(seed);
    expect_round_trip(base, edited_map(base, seed + 1000));
  }
}

TEST(AppliedSource, WorksOnMapsInMemory) {
  const Map base = random_map(5), other = edited_map(base, 6);
  const Bytes bytes = delta_of(base, other);
  const Reader delta(bytes);
  const AppliedSource view(base, delta);
  Map out(view.header());
  MapSink sink(out);
  copy(view, view.header().types, sink, false);
  EXPECT_EQ(difference(out, other, true), "");
}

TEST(AppliedSource, BringsAnythingFromAndToNothing) {
  const Map full = random_map(1), empty(full.header()), bare{MapHeader{}};
  expect_round_trip(full, empty);
  expect_round_trip(empty, full);
  expect_round_trip(full, bare);
  expect_round_trip(bare, full);
  expect_round_trip(bare, bare);
  expect_round_trip(full, full);
}

TEST(AppliedSource, TakesStampsAndHeadersAlong) {
  const Map base = random_map(2);
  test::Edits edits;
  edits.changed = edits.dropped = edits.added = 0;
  edits.restamped = 0.5;
  edits.other_types = false;
  const Map other = edited_map(base, 3, edits);
  EXPECT_EQ(content_id_of(base), content_id_of(other));
  EXPECT_NE(to_bytes(base), to_bytes(other));
  expect_round_trip(base, other);
}

TEST(AppliedSource, ReachesTheEndsOfTheIndices) {
  test::RandomMapOptions options;
  constexpr auto kMin = std::numeric_limits<std::int32_t>::min(),
                 kMax = std::numeric_limits<std::int32_t>::max();
  Map base = random_map(4), other = base;
  const Layer layer = base.by_key().begin()->second.layers.begin()->second;
  const TypeId type = base.by_key().begin()->second.layers.begin()->first;
  base.patch({kMin, kMax}).layers[type] = layer;
  other.patch({kMax, kMin}).layers[type] = layer;
  expect_round_trip(base, other);
}

TEST(AppliedSource, Chains) {
  const Map first = random_map(20), second = edited_map(first, 21), third = edited_map(second, 22);
  const Bytes base = to_bytes(first), a = delta_of(first, second), b = delta_of(second, third);
  const Reader base_reader(base), to_second(a), to_third(b);
  const AppliedSource middle(base_reader, to_second);
  EXPECT_EQ(applied(middle, to_third), to_bytes(third));
  // In the other order the second delta finds another base.
  EXPECT_EQ(refusal(base_reader, to_third).code(), ErrorCode::kIncompatible);
}

TEST(AppliedSource, PassesStoredBytesOn) {
  const Map base = random_map(23), other = edited_map(base, 24);
  const Bytes base_bytes = to_bytes(base), delta_bytes = delta_of(base, other);
  const Reader base_reader(base_bytes), delta(delta_bytes);
  const AppliedSource view(base_reader, delta);
  Bytes bytes;
  Writer writer(bytes, view.header());
  const CopyReport report = copy(view, view.header().types, writer, false);
  EXPECT_EQ(report.layers, report.layers_stored);
  EXPECT_GT(report.layers, 10u);
}

TEST(AppliedSource, KeepsToARange) {
  const Map base = random_map(25), other = edited_map(base, 26);
  const Bytes bytes = delta_of(base, other);
  const Reader delta(bytes);
  const AppliedSource view(base, delta);
  const PatchRange range{{-2, -1}, {1, 2}};
  std::vector<PatchIndex> all, within;
  PatchInfo patch;
  for (const auto cursor = other.patches(range); cursor->next(patch);) all.push_back(patch.patch);
  for (const auto cursor = view.patches(range); cursor->next(patch);) within.push_back(patch.patch);
  EXPECT_EQ(all, within);
  EXPECT_FALSE(all.empty());
}

TEST(AppliedSource, RefusesAnotherBaseAndNamesBoth) {
  const Map base = random_map(30), other = edited_map(base, 31), third = random_map(32);
  const Bytes bytes = delta_of(base, other);
  const Reader delta(bytes);
  const Error wrong = refusal(third, delta);
  EXPECT_EQ(wrong.code(), ErrorCode::kIncompatible);
  EXPECT_NE(wrong.message().find(content_id_of(base)), std::string::npos);
  EXPECT_NE(wrong.message().find(content_id_of(third)), std::string::npos);
  const Error twice = refusal(other, delta);
  EXPECT_EQ(twice.code(), ErrorCode::kIncompatible);
  EXPECT_NE(twice.hint().find("already"), std::string::npos);
}

TEST(AppliedSource, RefusesAnotherFrame) {
  const Map base = random_map(33), other = edited_map(base, 34);
  test::RandomMapOptions options;
  options.frame.frame_id = "odom";
  const Map odom = random_map(33, options);
  const Bytes bytes = delta_of(base, other);
  EXPECT_EQ(refusal(odom, Reader(bytes)).code(), ErrorCode::kIncompatible);
  const Bytes forged =
      relabelled(bytes, [&](auto& metadata) { metadata["apgm.base"] = content_id_of(odom); });
  EXPECT_EQ(refusal(odom, Reader(forged)).code(), ErrorCode::kIncompatible);
}

TEST(AppliedSource, RefusesWhatIsNoDelta) {
  const Map base = random_map(35);
  EXPECT_EQ(refusal(base, base).code(), ErrorCode::kForeign);
  const Bytes message = to_bytes(MapChanges{base, {}});
  EXPECT_EQ(refusal(base, Reader(message)).code(), ErrorCode::kForeign);
}

TEST(AppliedSource, FindsDamage) {
  const Map base = random_map(36), other = edited_map(base, 37);
  const Bytes bytes = delta_of(base, other);
  using Metadata = std::map<std::string, std::string>;
  const std::vector<std::function<void(Metadata&)>> edits{
      [](Metadata& m) { m["apgm.base"] = "no id"; },
      [](Metadata& m) { m["apgm.result"] = m["apgm.result"].substr(1) + "X"; },
      [](Metadata& m) { m["apgm.result"] = m["apgm.base"]; },
      [](Metadata& m) { m["apgm.gone"] = "1 2"; },
      [](Metadata& m) { m.erase("apgm.gone"); },
  };
  for (std::size_t i = 0; i < edits.size(); ++i) {
    SCOPED_TRACE(i);
    const Bytes forged = relabelled(bytes, edits[i]);
    const Error error = refusal(base, Reader(forged));
    EXPECT_EQ(error.code(), ErrorCode::kDamaged) << error.message();
  }
  // A layer that is both changed and gone.
  PatchInfo patch;
  const Reader reader(bytes);
  ASSERT_TRUE(reader.patches()->next(patch));
  const std::string place = std::to_string(patch.patch.x) + " " + std::to_string(patch.patch.y) + " " +
                            reader.header().types[patch.layers[0].type].name;
  const Bytes both = relabelled(bytes, [&](Metadata& m) { m["apgm.gone"] = place; });
  EXPECT_EQ(refusal(base, Reader(both)).code(), ErrorCode::kDamaged);
}

TEST(AppliedSource, RefusesDeltasOfDeltas) {
  const Map base = random_map(38), other = edited_map(base, 39);
  const Bytes bytes = delta_of(base, other);
  const Reader delta(bytes);
  EXPECT_EQ(failure([&] { delta_of(base, delta); }).code(), ErrorCode::kIncompatible);
}

TEST(Delta, IsSizedByWhatChanged) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map base(header);
  test::Random random(40);
  for (int y = -50; y < 50; ++y) {
    for (int x = -50; x < 50; ++x) {
      base.patch({x, y}).layers[0] = test::random_layer(header.types[0], random);
    }
  }
  Map other = base;
  other.patch({7, -3}).layers[0] = test::random_layer(header.types[0], random);
  const Bytes base_bytes = to_bytes(base), other_bytes = to_bytes(other);
  const Reader base_reader(base_bytes), other_reader(other_bytes);
  const Bytes delta = delta_of(base_reader, other_reader);
  EXPECT_LT(delta.size(), base_bytes.size() / 50);
  EXPECT_LT(delta.size(), 8192u);
  EXPECT_EQ(applied(base_reader, Reader(delta)), other_bytes);
}

TEST(AppliedSource, SaysWhatTheHungrierOfItsSourcesTakes) {
  const Map base = random_map(1), other = edited_map(base, 2);
  const Bytes bytes = delta_of(base, other);
  const Reader delta(bytes);
  const WatchedSource watched_base(base), watched_delta(delta);
  EXPECT_EQ(AppliedSource(base, delta).working_bytes(100), 0u);
  EXPECT_EQ(AppliedSource(watched_base, delta).working_bytes(100), 300u);
  EXPECT_EQ(AppliedSource(base, watched_delta).working_bytes(100), 300u);
  EXPECT_EQ(AppliedSource(watched_base, watched_delta).working_bytes(100), 300u);
}

TEST(CheckBase, RefusesAnotherMapAndADelta) {
  const Map base = random_map(1), other = edited_map(base, 2);
  const std::string base_id = content_id_of(base), other_id = content_id_of(other);
  check_base(base, base_id, other_id);
  check_base(base, base_id, "");
  const Error error = failure([&] { check_base(other, base_id, other_id, {"b.apgm", "d"}); });
  EXPECT_EQ(error.code(), ErrorCode::kIncompatible);
  EXPECT_NE(error.message().find("'d' is for another base"), std::string::npos) << error.message();
  const Bytes bytes = delta_of(base, other);
  const Reader delta(bytes);
  EXPECT_EQ(failure([&] { check_base(delta, delta.content_id(), other_id); }).code(),
            ErrorCode::kIncompatible);
}

}  // namespace
}  // namespace apgm

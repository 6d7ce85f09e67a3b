#include "apgm/ops/blame.hpp"

#include <gtest/gtest.h>

#include "apgm/format/content_id.hpp"
#include "apgm/ops/merge.hpp"
#include "random_map.hpp"

namespace apgm {
namespace {

constexpr Point kPoint{1.0, 2.0};

/// One cell of 3.2 m that holds kPoint, with these masses; the frame's datum is moved by whole patches.
Map cell_map(float occupied, float free, int shift_patches = 0) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  header.frame.datum_x_um = shift_patches * header.frame.edge_um;
  Map map(header);
  Layer& layer = map.layer({-shift_patches, 0}, 0, 2);
  layer.at(0, {0, 0}) = occupied;
  layer.at(1, {0, 0}) = free;
  layer.stamp_ns = 5;
  return map;
}

Map merged(const std::vector<const PatchSource*>& inputs) {
  std::vector<MergeInput> merge_inputs;
  for (const PatchSource* input : inputs) merge_inputs.push_back({input, "input", 1.0f});
  const MergePlan plan(std::move(merge_inputs), {});
  Map out(plan.header());
  MapSink sink(out);
  plan.run(sink);
  return out;
}

/// A map in memory that knows its content id, as files do.
class NamedMap final : public PatchSource {
 public:
  explicit NamedMap(Map map) : map_(std::move(map)), id_(content_id_of(map_)) {}
  const MapHeader& header() const override { return map_.header(); }
  Summary summary() const override { return map_.summary(); }
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override {
    return map_.patches(range);
  }
  void load(const LayerInfo& info, Layer& out) const override { map_.load(info, out); }
  std::string content_id() const override { return id_; }

 private:
  Map map_;
  std::string id_;
};

TEST(KnownCells, AreThoseWithData) {
  const Map map = cell_map(0.5f, 0.25f);
  const auto cells = known_cells(map, kPoint);
  ASSERT_EQ(cells.size(), 1u);
  EXPECT_EQ(cells[0].type.name, "occupancy");
  EXPECT_EQ(cells[0].step, 2);
  EXPECT_EQ(cells[0].stamp_ns, 5);
  EXPECT_EQ(cells[0].values, (std::vector<float>{0.5f, 0.25f}));
  EXPECT_TRUE(known_cells(map, {4.0, 2.0}).empty());
  EXPECT_TRUE(known_cells(map, {-1.0, 2.0}).empty());
}

TEST(Blame, NamesTheInputsThatObserved) {
  const NamedMap a(cell_map(0.5f, 0.25f)), b(cell_map(0.25f, 0.5f, 3)), elsewhere(cell_map(0, 0)),
      lost(cell_map(0.125f, 0.125f));
  const NamedMap stranger(cell_map(0.75f, 0.0f));
  const Map map = merged({&a, &b, &elsewhere, &lost});
  const std::vector<BlameInput> inputs{{&stranger, "s"}, {&b, "b"}, {&elsewhere, "e"}, {&a, "a"}};
  const Blame found = blame(map, kPoint, inputs);
  EXPECT_EQ(found.cells.size(), 1u);
  EXPECT_EQ(found.strangers, std::vector<std::size_t>{0});
  ASSERT_EQ(found.ancestors.size(), 4u);
  for (const Ancestor& ancestor : found.ancestors) {
    EXPECT_EQ(ancestor.step->operation, "merge");
    EXPECT_EQ(ancestor.depth, 1);
    if (ancestor.id == lost.content_id()) {
      EXPECT_FALSE(ancestor.input);
      EXPECT_TRUE(ancestor.cells.empty());
      continue;
    }
    ASSERT_TRUE(ancestor.input);
    EXPECT_EQ(inputs[*ancestor.input].source->content_id(), ancestor.id);
    EXPECT_EQ(ancestor.cells.size(), *ancestor.input == 2 ? 0u : 1u);
  }
}

TEST(Blame, FollowsTheHistoriesOfInputs) {
  const NamedMap a(cell_map(0.5f, 0.25f)), b(cell_map(0.25f, 0.5f)), c(cell_map(0.125f, 0.5f));
  const NamedMap ab(merged({&a, &b}));
  const Map map = merged({&ab, &c});
  const Blame found = blame(map, kPoint, {{&ab, "ab"}, {&a, "a"}});
  ASSERT_EQ(found.ancestors.size(), 4u);
  std::map<std::string, int> depths;
  for (const Ancestor& ancestor : found.ancestors) depths[ancestor.id] = ancestor.depth;
  EXPECT_EQ(depths,
            (std::map<std::string, int>{
                {ab.content_id(), 1}, {c.content_id(), 1}, {a.content_id(), 2}, {b.content_id(), 2}}));
  // Without the file of `ab` its history is not known: those of the inputs differ, and none was kept.
  EXPECT_EQ(blame(map, kPoint, {{&a, "a"}}).ancestors.size(), 2u);
}

TEST(Blame, FollowsTheMapsOwnHistory) {
  MapHeader header = cell_map(0.5f, 0.5f).header();
  header.history = {{"convert", {"octomap"}, "{}"}, {"crop", {"aa"}, "{}"}, {"crop", {"bb"}, "{}"}};
  const Blame found = blame(Map(header), kPoint, {});
  ASSERT_EQ(found.ancestors.size(), 3u);
  EXPECT_EQ(found.ancestors[0].id, "bb");
  EXPECT_EQ(found.ancestors[2].id, "octomap");
  EXPECT_EQ(found.ancestors[2].depth, 3);
  EXPECT_EQ(found.ancestors[2].step->operation, "convert");
}

TEST(Blame, EndsWhereAHistoryNamesItself) {
  MapHeader header = cell_map(0.5f, 0.5f).header();
  const std::string own = content_id_of(cell_map(0.5f, 0.25f));
  header.history = {{"merge", {own, "aa"}, "{}"}, {"merge", {own, "bb"}, "{}"}};
  Map map(header);
  map.patch({0, 0}) = cell_map(0.5f, 0.25f).by_key().begin()->second;
  EXPECT_EQ(blame(map, kPoint, {{&map, "map"}}).ancestors.size(), 3u);
}

TEST(Blame, IsQuickForHistoriesOfManyInputs) {
  MapHeader header = cell_map(0.5f, 0.5f).header();
  for (int step = 0; step < 3; ++step) {
    Provenance& merge = header.history.emplace_back(Provenance{"merge", {}, "{}"});
    for (int i = 0; i < 65536; ++i) merge.inputs.push_back(std::to_string(step) + "_" + std::to_string(i));
  }
  EXPECT_EQ(blame(Map(header), kPoint, {}).ancestors.size(), 3u * 65536u);
}

}  // namespace
}  // namespace apgm

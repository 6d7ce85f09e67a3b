#include "apgm/fuse/map_fuser.hpp"

#include <gtest/gtest.h>

#include "apgm/core/error.hpp"
#include "apgm/fuse/resample.hpp"
#include "layers.hpp"

namespace apgm {
namespace {

using test::Random;

const LayerType kOccupancy = LayerType::occupancy();
const LayerType kSurface = LayerType::semantic("surface", {"Road", "Marking", "Blocked"});
const LayerType kHeight = LayerType::real("height", {"z"}, Policy::kMaximum);

/// A few patches near the origin; each type of `types` in about two thirds of them, at steps from `finest`
/// down.
Map random_map(const TypeTable& types, int finest, Random& random) {
  MapHeader header;
  header.types = types;
  header.stamp_ns = static_cast<std::int64_t>(random() % 1000);
  Map map(std::move(header));
  for (int i = 0; i < 8; ++i) {
    const PatchIndex index{static_cast<std::int32_t>(random() % 4) - 2,
                           static_cast<std::int32_t>(random() % 3) - 1};
    for (TypeId id = 0; id < types.size(); ++id) {
      if (random() % 3 == 0) continue;
      const int step = finest - static_cast<int>(random() % 2);
      Layer layer = types[id].is_occupancy()  ? test::random_occupancy(step, random)
                    : types[id].is_evidence() ? test::random_semantic(types[id], step, random)
                                              : test::random_real(types[id], step, random);
      map.patch(index).layers.insert_or_assign(id, std::move(layer));
    }
  }
  map.prune();
  return map;
}

bool same_maps(const Map& a, const Map& b) {
  if (a.header().types != b.header().types || a.header().stamp_ns != b.header().stamp_ns ||
      a.size() != b.size()) {
    return false;
  }
  for (const auto& [key, patch] : a.by_key()) {
    const Patch* other = b.find(patch.index);
    if (other == nullptr || other->layers.size() != patch.layers.size()) return false;
    for (const auto& [type, layer] : patch.layers) {
      const auto it = other->layers.find(type);
      if (it == other->layers.end() || !same_cells(layer, it->second)) return false;
    }
  }
  return true;
}

/// The definition: union of patches, union of types, every input resampled whole, discounted, then combined.
Map by_definition(std::span<const Map* const> maps, const FuseOptions& options) {
  MapHeader header = maps[0]->header();
  std::vector<const TypeTable*> tables;
  for (const Map* map : maps) {
    tables.push_back(&map->header().types);
    header.stamp_ns = std::max(header.stamp_ns, map->header().stamp_ns);
  }
  header.types = fused_types(tables);
  Map out(header);
  for (int x = -2; x < 3; ++x) {
    for (int y = -2; y < 3; ++y) {
      for (TypeId id = 0; id < header.types.size(); ++id) {
        const LayerType& type = header.types[id];
        int step = -1;
        for (const Map* map : maps) {
          const auto own = map->header().types.find(type.name);
          const Layer* layer = own ? map->find({x, y}, *own) : nullptr;
          if (layer != nullptr) step = std::max(step, layer->step());
        }
        if (step < 0) continue;
        if (options.required) {
          const auto required = options.required({x, y}, type);
          if (!required) continue;
          step = std::min(step, *required);
        }
        std::vector<Layer> layers;
        for (std::size_t i = 0; i < maps.size(); ++i) {
          const auto own = maps[i]->header().types.find(type.name);
          const Layer* layer = own ? maps[i]->find({x, y}, *own) : nullptr;
          if (layer == nullptr) continue;
          layers.emplace_back();
          resample(*layer, maps[i]->header().types[*own], step, layers.back());
          discount(layers.back(), type, options.alphas.empty() ? 1.0f : options.alphas[i]);
        }
        std::vector<const Layer*> inputs;
        for (const Layer& layer : layers) inputs.push_back(&layer);
        const auto rule = options.rule_of.find(type.name);
        Layer fused;
        combine(inputs, type, rule == options.rule_of.end() ? options.rule : rule->second, fused);
        if (!is_vacuous(fused, type)) out.patch({x, y}).layers.insert_or_assign(id, std::move(fused));
      }
    }
  }
  return out;
}

std::vector<FuseOptions> some_options() {
  std::vector<FuseOptions> all(4);
  all[1].rule = Rule::kYager;
  all[1].rule_of = {{"surface", Rule::kMax}, {"height", Rule::kLast}};
  all[2].alphas = {1.0f, 0.75f, 0.5f};
  all[3].alphas = {0.9f, 1.0f, 0.0f};
  all[3].rule = Rule::kMean;
  all[3].required = [](PatchIndex patch, const LayerType& type) -> std::optional<int> {
    if (patch.x < -1 || (type.name == "height" && patch.y > 0)) return {};
    return 2 + patch.x;
  };
  return all;
}

TEST(MapFuser, GivesTheDefinitionAgainAndAgain) {
  Random random(81);
  MapFuser fuser;  // one for all: what it keeps must not show
  const TypeTable lidar({kOccupancy, kHeight}), camera({kSurface}), both({kOccupancy, kSurface});
  for (int round = 0; round < 12; ++round) {
    const Map a = random_map(lidar, 4, random), b = random_map(camera, 3, random),
              c = random_map(both, 5, random);
    const std::array<const Map*, 3> maps{&a, &b, &c};
    for (const FuseOptions& options : some_options()) {
      const Map want = by_definition(maps, options);
      ASSERT_TRUE(same_maps(fuser.fuse(maps, options), want)) << "seed 81, round " << round;
      // In place, in a map that has the types already.
      Map target(want.header());
      target.set_stamp_ns(a.header().stamp_ns);
      for (const auto& [key, patch] : a.by_key()) {
        for (const auto& [id, layer] : patch.layers) {
          const TypeId own = *want.header().types.find(lidar[id].name);
          target.patch(patch.index).layers.insert_or_assign(own, layer);
        }
      }
      fuser.fuse_into(target, std::span(maps).subspan(1), options);
      ASSERT_TRUE(same_maps(target, want)) << "in place; seed 81, round " << round;
    }
  }
}

TEST(MapFuser, KeepsItsMemory) {
  Random random(82);
  const Map a = random_map(TypeTable({kOccupancy}), 5, random),
            b = random_map(TypeTable({kOccupancy}), 5, random);
  MapFuser fuser;
  const auto planes_of = [](const Map& map) {
    std::vector<const float*> planes;
    for (const auto& [key, patch] : map.by_key()) {
      for (const auto& [id, layer] : patch.layers) planes.push_back(layer.plane(0).data());
    }
    std::sort(planes.begin(), planes.end());
    return planes;
  };
  const auto first = planes_of(fuser.fuse(std::array{&a, &b}));
  EXPECT_EQ(planes_of(fuser.fuse(std::array{&a, &b})), first);
  const auto fewer = planes_of(fuser.fuse(std::array{&a}));
  EXPECT_TRUE(std::includes(first.begin(), first.end(), fewer.begin(), fewer.end()));
  EXPECT_EQ(planes_of(fuser.fuse(std::array{&a, &b})), first);
}

TEST(MapFuser, SmallLayersDoNotKeepTheMemoryOfLargeOnes) {
  MapHeader header;
  header.types = TypeTable({kOccupancy});
  Map large(header), small(header);
  for (std::int32_t i = 0; i < 20; ++i) {
    large.layer({i, 0}, 0, 8).plane(0)[0] = 0.5f;
    small.layer({i, 1}, 0, 3).plane(0)[0] = 0.5f;
  }
  MapFuser fuser;
  fuser.fuse(std::array<const Map*, 1>{&large});
  for (const auto& [key, patch] : fuser.fuse(std::array<const Map*, 1>{&small}).by_key()) {
    for (const auto& [id, layer] : patch.layers) EXPECT_LE(layer.capacity_bytes(), 4 * layer.value_bytes());
  }
}

TEST(MapFuser, LeavesWhatOnlyTheTargetHasWhereItStands) {
  Random random(83);
  Map target(MapHeader{.frame = {}, .types = TypeTable({kOccupancy}), .metadata = {}, .history = {}});
  Map other(target.header());
  Layer& layer = target.layer({0, 0}, 0, 4);
  layer = test::random_occupancy(4, random);
  other.layer({5, 5}, 0, 4) = test::random_occupancy(4, random);
  const Layer before = layer;
  const float* plane = layer.plane(0).data();
  MapFuser().fuse_into(target, std::array<const Map*, 1>{&other});
  EXPECT_EQ(target.find({0, 0}, 0)->plane(0).data(), plane);
  EXPECT_TRUE(same_cells(*target.find({0, 0}, 0), before));
  EXPECT_EQ(target.size(), 2u);
}

TEST(MapFuser, CountsTotalConflictAndDropsWhatBecomesVacuous) {
  Map a(MapHeader{.frame = {}, .types = TypeTable({kOccupancy}), .metadata = {}, .history = {}}),
      b(a.header());
  a.layer({0, 0}, 0, 1).plane(0)[2] = 1.0f;
  b.layer({0, 0}, 0, 1).plane(1)[2] = 1.0f;
  MapFuser fuser;
  EXPECT_EQ(fuser.fuse(std::array<const Map*, 2>{&a, &b}).size(), 0u);
  EXPECT_EQ(fuser.report().total_conflicts, 1u);
  fuser.fuse_into(a, std::array<const Map*, 1>{&b});
  EXPECT_EQ(a.size(), 0u);
}

TEST(MapFuser, RefusesWhatDoesNotFitAndLeavesTheTarget) {
  Random random(84);
  Map a = random_map(TypeTable({kOccupancy}), 3, random);
  const Map same = a, surface = random_map(TypeTable({kSurface}), 3, random);
  MapHeader moved;
  moved.frame.datum_x_um = 1;
  const Map elsewhere(moved);
  MapFuser fuser;
  EXPECT_THROW(fuser.fuse({}), Error);
  EXPECT_THROW(fuser.fuse(std::array<const Map*, 2>{&a, &elsewhere}), Error);
  EXPECT_THROW(fuser.fuse_into(a, std::array<const Map*, 1>{&elsewhere}), Error);
  EXPECT_THROW(fuser.fuse_into(a, std::array<const Map*, 1>{&surface}), Error);
  FuseOptions options;
  options.alphas = {0.5f};
  EXPECT_THROW(fuser.fuse_into(a, std::array<const Map*, 1>{&same}, options), Error);
  options.alphas = {0.5f, 1.5f};
  EXPECT_THROW(fuser.fuse_into(a, std::array<const Map*, 1>{&same}, options), Error);
  EXPECT_TRUE(same_maps(a, same));
  options = {};
  options.required = [](PatchIndex, const LayerType&) { return std::optional<int>(-1); };
  EXPECT_THROW(fuser.fuse(std::array<const Map*, 1>{&a}, options), Error);
}

}  // namespace
}  // namespace apgm

#include <bit>
#include <limits>

#include "bodies.hpp"
#include "corpus.hpp"
#include "random_map.hpp"
#include "temp_dir.hpp"
#include "tests/format/sample_map.hpp"

namespace apgm::test {
namespace {

std::string written(const Map& map, Lossy lossy = Lossy::kNone, int level = 3) {
  const TempDir dir;
  WriterOptions options;
  options.lossy = lossy;
  options.level = level;
  write_map(map, dir / "a.apgm", options);
  return read_file(dir / "a.apgm");
}

Map map_of(std::vector<LayerType> types) {
  MapHeader header;
  header.types = TypeTable(std::move(types));
  return Map(std::move(header));
}

void fill(Layer& layer, const std::vector<float>& tuple) {
  for (int c = 0; c < layer.channels(); ++c) {
    std::ranges::fill(layer.plane(c), tuple[static_cast<std::size_t>(c)]);
  }
}

Map empty_map(bool with_types) {
  if (!with_types) return map_of({});
  return map_of({LayerType::occupancy(), LayerType::real("height", {"z"})});
}

/// Each type of layer with one tuple in all cells.
Map constants() {
  Map map =
      map_of({LayerType::occupancy(), LayerType::real("height", {"z"}),
              LayerType::real("hits", {"n"}, Policy::kSum), LayerType::semantic("semantic", {"a", "b"})});
  for (const int step : {0, 1, 3, 5}) {
    fill(map.layer({step, -step}, 0, step), {-4.25f});
    fill(map.layer({step, -step}, 1, step), {17});
    fill(map.layer({step, -step}, 2, step), {0, 0.75f});
    fill(map.layer({step, -step}, 3, step), {0.25f, 0.5f, 0.25f});
  }
  return map;
}

/// Continuous masses: no palette pays. `noise` keeps low byte planes raw.
Map continuous(int step, int values_of) {
  Map map = map_of({LayerType::occupancy()});
  Random random(17);
  Layer& layer = map.layer({0, 0}, 0, step);
  for (std::size_t i = 0; i < layer.cells(); ++i) {
    const auto mass = static_cast<float>(values_of > 0 ? random.below(values_of) / 65536.0 : random.unit());
    if (random.chance(0.3)) continue;
    layer.plane(random.chance(0.2) ? 0 : 1)[i] = mass;
  }
  return map;
}

/// Cells that hold one of so many values each.
Map stepped(int step, int tuples) {
  Map map = map_of({LayerType::occupancy()});
  Layer& layer = map.layer({-1, 2}, 0, step);
  Random random(5);
  std::vector<float> values;
  for (int i = 0; i < tuples; ++i) values.push_back(static_cast<float>(random.unit()));
  for (float& value : layer.plane(0)) value = values[static_cast<std::size_t>(random.below(tuples))];
  return map;
}

Map every_policy() {
  std::vector<LayerType> types{LayerType::semantic("evidence", {"a", "b"}, Policy::kEvidence),
                               LayerType::semantic("mean-masses", {"a", "b"}, Policy::kMean),
                               LayerType::real("mean-values", {"v"}, Policy::kMean),
                               LayerType::real("sum", {"v"}, Policy::kSum),
                               LayerType::real("minimum", {"v"}, Policy::kMinimum),
                               LayerType::real("maximum", {"v"}, Policy::kMaximum)};
  for (const Policy policy : {Policy::kExclusive, Policy::kConditional, Policy::kMin, Policy::kProduct,
                              Policy::kMedian, Policy::kDempster}) {
    types.push_back(LayerType::occupancy(std::string(to_string(policy)), policy));
  }
  LayerType implicit = LayerType::semantic("implicit-omega", {"a", "b", "c"}, Policy::kMean);
  implicit.channels.pop_back();
  types.push_back(implicit);
  Map map = map_of(types);
  for (std::size_t t = 0; t < map.header().types.size(); ++t) {
    const auto id = static_cast<TypeId>(t);
    Layer& layer = map.layer({1, 1}, id, 2);
    const LayerType& type = map.header().types[id];
    const int singletons = layer.channels() - (type.stores_omega() ? 1 : 0);
    for (int c = 0; c < singletons; ++c) {
      layer.at(c, {c, 1}) = 0.25f;
      if (type.stores_omega()) layer.at(singletons, {c, 1}) = 0.75f;
    }
  }
  return map;
}

/// Most hypotheses and channels that a type can have, and layers of it that are hardly known.
Map many_hypotheses() {
  std::vector<std::string> classes;
  for (int i = 0; i < 15; ++i) classes.push_back("class-" + std::to_string(i));
  Map map = map_of({LayerType::semantic("semantic", classes)});
  Layer& layer = map.layer({5, 5}, 0, 3);
  for (int k = 0; k < 15; ++k) {
    layer.at(k, {k % 8, k / 8}) = static_cast<float>(k + 1) / 16.0f;
    layer.at(15, {k % 8, k / 8}) = 1 - static_cast<float>(k + 1) / 16.0f;
  }
  return map;
}

Map real_values() {
  constexpr float kMost = std::numeric_limits<float>::max();
  constexpr float kLeast = std::numeric_limits<float>::denorm_min();
  Map map = map_of({LayerType::real("velocity", {"vx", "vy"}), LayerType::real("hits", {"n"}, Policy::kSum)});
  const std::vector<float> values{0, 1, -1, kMost, -kMost, kLeast, -kLeast, 1e-20f};
  Layer& hits = map.layer({0, -1}, 0, 2);
  Layer& velocity = map.layer({0, -1}, 1, 2);
  for (std::size_t i = 0; i < values.size(); ++i) {
    hits.plane(0)[2 * i] = velocity.plane(0)[i] = velocity.plane(1)[15 - i] = values[i];
  }
  hits.plane(0)[3] = std::numeric_limits<float>::quiet_NaN();  // a count may be unknown, too
  return map;
}

/// The ends of every range that a header, an index and a mass has.
Map extremes(bool low) {
  constexpr auto kLow = std::numeric_limits<std::int32_t>::min();
  constexpr auto kHigh = std::numeric_limits<std::int32_t>::max();
  MapHeader header;
  header.frame.edge_um = low ? 1'000 : 10'000'000'000;
  header.frame.datum_x_um = low ? -1'000'000'000'000'000 : 1'000'000'000'000'000;
  header.frame.datum_y_um = -header.frame.datum_x_um;
  header.frame.epsg = low ? 1 : 999'999;
  header.frame.frame_id = low ? "m" : std::string(251, 'f') + "\xf0\x9f\x97\xba";
  header.stamp_ns = low ? std::numeric_limits<std::int64_t>::min() : std::numeric_limits<std::int64_t>::max();
  LayerType type = LayerType::occupancy(low ? "o" : std::string(64, 'n'));
  type.slab = low ? Slab{-1'000'000'000'000, -999'999'999'999} : Slab{0, 1'000'000'000'000};
  header.types = TypeTable({type});
  Map map(header);
  const std::uint32_t smallest = 1, largest = 0x3f800000;
  for (const PatchIndex index :
       {PatchIndex{kLow, kLow}, PatchIndex{kLow, kHigh}, PatchIndex{kHigh, kLow}, PatchIndex{kHigh, kHigh},
        PatchIndex{-1, -1}, PatchIndex{-1, 0}, PatchIndex{0, -1}, PatchIndex{0, 0}}) {
    Layer& layer = map.layer(index, 0, 0);
    layer.plane(0)[0] = std::bit_cast<float>(low ? smallest : largest);
    layer.stamp_ns = header.stamp_ns;
  }
  return map;
}

/// Sums at the very ends of what rounding may do to them.
Map sums_at_their_limits() {
  Map map = map_of({LayerType::occupancy(), LayerType::semantic("semantic", {"a", "b"})});
  Layer& occupancy = map.layer({0, 0}, 0, 1);
  occupancy.plane(0)[0] = 0.5f;
  occupancy.plane(1)[0] = std::bit_cast<float>(0x3f000010u);  // sum 0x3f800008
  Layer& semantic = map.layer({0, 0}, 1, 1);
  semantic.plane(0)[0] = 0.5f;
  semantic.plane(2)[0] = std::bit_cast<float>(0x3effffdeu);  // sum 0x3f7fffef
  semantic.plane(0)[1] = 0.5f;
  semantic.plane(2)[1] = std::bit_cast<float>(0x3f000010u);
  return map;
}

Map finest_step() {
  Map map = map_of({LayerType::occupancy(), LayerType::real("height", {"z"})});
  fill(map.layer({0, 0}, 0, kMaxStep), {1.5f});
  Layer& sparse = map.layer({0, 0}, 1, kMaxStep);
  sparse.at(0, {0, 0}) = 0.5f;
  sparse.at(1, {2047, 2047}) = 0.25f;
  for (int i = 0; i < 300; ++i) sparse.at(1, {i * 5, i * 6}) = static_cast<float>(i + 1) / 512.0f;
  return map;
}

/// More layers than a page of the index takes; the page ends between the layers of a patch.
Map two_pages() {
  Map map = map_of({LayerType::occupancy(), LayerType::real("height", {"z"})});
  for (int i = 0; i < 523; ++i) {
    const PatchIndex index{i % 29 - 14, i / 29 - 9};
    Layer& height = map.layer(index, 0, 0);
    height.plane(0)[0] = static_cast<float>(i);
    if (i != 0) map.layer(index, 1, 0).plane(1)[0] = static_cast<float>(i) / 1024.0f;
  }
  return map;
}

Map texts() {
  MapHeader header;
  header.metadata = {{"empty", ""},
                     {"lines", "one\ntwo\ttabbed"},
                     {"site", "Ulm \xe2\x80\x93 Gr\xc3\xbcner Hof \xf0\x9f\x9a\x97"},
                     {"\xc3\xa9 key with spaces", "\x01\x7f"}};
  header.history = {{"convert", {"octomap"}, "{\"layer\":\"occupancy\"}"},
                    {"merge", {std::string(32, 'a'), std::string(32, 'b')}, "{}"},
                    {"crop", {}, ""}};
  header.types = TypeTable({LayerType::occupancy("A.b+c-d_0")});
  header.stamp_ns = 1'700'000'000'000'000'000;
  Map map(header);
  Layer& layer = map.layer({3, -3}, 0, 1);
  layer.plane(0)[2] = 0.125f;
  layer.stamp_ns = -1;
  return map;
}

Map mixed() {
  RandomMapOptions options;
  options.range = {{-2, -2}, {1, 1}};
  options.max_step = 4;
  Map map = random_map(4, options);
  return map;
}

}  // namespace

std::vector<GoodFile> written_files() {
  return {{"empty", written(empty_map(false))},
          {"empty_with_types", written(empty_map(true))},
          {"constant", written(constants())},
          {"masked32", written(continuous(4, 16'384))},
          {"masked32_two_raw_planes", written(continuous(6, 0))},
          {"masked32_one_cell", written(continuous(0, 0))},
          {"palette", written(stepped(5, 9))},
          {"palette_of_many_tuples", written(stepped(6, 300))},
          {"masked16", written(continuous(4, 0), Lossy::kU16)},
          {"masked8", written(continuous(4, 0), Lossy::kU8)},
          {"every_policy", written(every_policy())},
          {"fifteen_hypotheses", written(many_hypotheses())},
          {"real_values", written(real_values())},
          {"extremes_low", written(extremes(true))},
          {"extremes_high", written(extremes(false))},
          {"sums_at_their_limits", written(sums_at_their_limits())},
          {"step_11", written(finest_step())},
          {"two_pages", written(two_pages())},
          {"texts", written(texts())},
          {"mixed", written(mixed())},
          {"mixed_level_19", written(mixed(), Lossy::kNone, 19)},
          {"mixed_lossy", written(mixed(), Lossy::kU8)}};
}

}  // namespace apgm::test

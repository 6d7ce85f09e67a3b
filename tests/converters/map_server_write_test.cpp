#include <filesystem>

#include "tests/converters/map_server_support.hpp"

namespace apgm::converters {
namespace {

using testing::collect;
using testing::open;
using testing::write;

using testing::beliefs;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::p5;
using testing::save_map;
using testing::YamlText;

bool same_maps(const Map& a, const Map& b) {
  if (a.header().frame != b.header().frame || a.size() != b.size()) return false;
  for (const auto& [key, patch] : a.by_key()) {
    const auto it = b.by_key().find(key);
    if (it == b.by_key().end() || !same_cells(patch.layers.at(0), it->second.layers.at(0))) return false;
  }
  return true;
}

/// Width and height of a PGM that this project wrote.
std::string pgm_size(const std::string& path) {
  const std::string text = testing::read_text(path);
  return text.substr(3, text.find('\n', 3) - 3);
}

class RealMaps : public ::testing::TestWithParam<std::tuple<const char*, const char*>> {};

TEST_P(RealMaps, ComeBackWithEveryCell) {
  const auto [name, size] = GetParam();
  const std::string original = testing::real_data(std::string("map_server/") + name + ".yaml");
  if (original.empty()) GTEST_SKIP() << "map_server/" << name << ".yaml is not there";
  const testing::TempDir dir;
  testing::Collected read_findings, findings;
  const Map map = collect(*open(map_server(), original, {}, &read_findings));
  EXPECT_GT(map.size(), 0u);
  write(map_server(), map, dir / "out.yaml", {}, &findings);
  EXPECT_THAT(findings.list, IsEmpty());
  if (std::filesystem::exists(dir / "out.pgm")) {
    EXPECT_EQ(pgm_size(dir / "out.pgm"), size);
  }
  const auto again = open(map_server(), dir / "out.yaml");
  const Map back = collect(*again);
  EXPECT_TRUE(same_maps(map, back));
  for (const char* key : {"width", "height", "origin", "resolution", "mode", "negate", "free_thresh"}) {
    const std::string k = std::string("map_server.") + key;
    EXPECT_EQ(map.header().metadata.at(k), back.header().metadata.at(k)) << key;
  }
  write(map_server(), back, dir / "again.yaml");
  for (const char* extension : {".pgm", ".png"}) {
    EXPECT_EQ(testing::read_text(dir / ("out" + std::string(extension))),
              testing::read_text(dir / ("again" + std::string(extension))));
  }
}

INSTANTIATE_TEST_SUITE_P(Recordings, RealMaps,
                         ::testing::Values(std::tuple("depot", "604 307"), std::tuple("columbia", "435 350"),
                                           std::tuple("berlin", "600 600"), std::tuple("depot_speed", ""),
                                           std::tuple("depot_keepout", "604 307"),
                                           std::tuple("warehouse", "1006 1674")),
                         [](const auto& p) { return std::string(std::get<0>(p.param)); });

TEST(MapServerWriter, UsesMapServersOwnGreys) {
  const testing::TempDir dir;
  const auto source = open(map_server(), save_map(dir, {}, p5({0, 205, 254, 7, 200, 255})));
  write(map_server(), *source, dir / "out.yaml");
  EXPECT_EQ(testing::read_text(dir / "out.pgm"),
            "P5\n3 2\n255\n" + std::string("\x00\xcd\xfe\x00\xcd\xfe", 6));
  EXPECT_EQ(testing::read_text(dir / "out.yaml"),
            "image: out.pgm\nmode: trinary\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\n"
            "occupied_thresh: 0.65\nfree_thresh: 0.196\n");
}

TEST(MapServerWriter, UnknownStaysUnknownWhateverTheThresholds) {
  const testing::TempDir dir;
  YamlText yaml;
  yaml.free_thresh = "0.25";  // 205 would read as free
  const Map map = collect(*open(map_server(), save_map(dir, yaml, p5({0, 140, 254, 0, 140, 254}))));
  write(map_server(), map, dir / "out.yaml");
  EXPECT_TRUE(same_maps(map, collect(*open(map_server(), dir / "out.yaml"))));
}

TEST(MapServerWriter, EveryModeAndPictureReadsBack) {
  for (const char* mode : {"trinary", "scale", "raw"}) {
    for (const char* image : {"pgm", "png"}) {
      for (const char* negate : {"0", "1"}) {
        if (std::string(mode) == "scale" && std::string(image) == "pgm") continue;
        const testing::TempDir dir;
        YamlText yaml;
        yaml.mode = mode;
        const Map map = collect(*open(map_server(), save_map(dir, yaml, p5({0, 11, 254, 99, 130, 255}))));
        testing::Collected findings;
        write(map_server(), map, dir / "out.yaml", {{"image", image}, {"negate", negate}}, &findings);
        EXPECT_THAT(findings.list, IsEmpty()) << mode;
        EXPECT_EQ(beliefs(map), beliefs(collect(*open(map_server(), dir / "out.yaml"))))
            << mode << image << negate;
      }
    }
  }
}

TEST(MapServerWriter, MapsOfOtherOriginCoverTheirKnownCells) {
  const testing::TempDir dir;
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy(), LayerType::semantic("road", {"Road", "Blocked"})});
  Map map(header);
  map.layer({0, 0}, 0, 7).at(0, {5, 6}) = 0.8f;
  map.layer({-1, 0}, 0, 6).at(1, {63, 0}) = 0.8f;
  map.layer({0, 0}, 1, 3).at(0, {1, 1}) = 0.5f;
  testing::Collected findings;
  write(map_server(), map, dir / "out.yaml", {}, &findings);
  EXPECT_THAT(findings.losses(), Contains(HasSubstr("2 cells keep only whether")));
  EXPECT_THAT(findings.losses(), Contains(HasSubstr("layer 'road' is left out")));
  EXPECT_EQ(pgm_size(dir / "out.pgm"), "8 7");
  const Map back = collect(*open(map_server(), dir / "out.yaml"));
  EXPECT_EQ(back.header().frame.datum_x_um, -200'000);
  EXPECT_EQ(testing::masses_at(back, "occupancy", 0.55, 0.65, 7).first, 0.9f);
  for (const double x : {-0.15, -0.05}) {
    for (const double y : {0.05, 0.15})
      EXPECT_EQ(testing::masses_at(back, "occupancy", x, y, 7).second, 0.9f);
  }
}

TEST(MapServerWriter, AMapThatGrewCoversAllOfIt) {
  const testing::TempDir dir;
  Map map = collect(*open(map_server(), save_map(dir, {}, p5({0, 205, 254, 205, 205, 205}))));
  map.layer({0, 0}, 0, 7).at(0, {9, 0}) = 0.9f;
  write(map_server(), map, dir / "out.yaml");
  EXPECT_EQ(pgm_size(dir / "out.pgm"), "10 2");
}

TEST(MapServerWriter, AnEmptyMapIsOnePixelAndSaysSo) {
  const testing::TempDir dir;
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  testing::Collected findings;
  write(map_server(), Map(header), dir / "out.yaml", {}, &findings);
  EXPECT_THAT(findings.of(Finding::Kind::kWarning), ElementsAre(HasSubstr("no known cells")));
  EXPECT_EQ(collect(*open(map_server(), dir / "out.yaml")).size(), 0u);
}

TEST(MapServerWriter, HugeExtentsAreRefused) {
  const testing::TempDir dir;
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  map.layer({0, 0}, 0, 7).at(0, {0, 0}) = 0.9f;
  map.layer({2'000'000'000, -2'000'000'000}, 0, 7).at(0, {0, 0}) = 0.9f;
  EXPECT_EQ(testing::error_of([&] { write(map_server(), map, dir / "out.yaml"); }).code(), ErrorCode::kLimit);
  EXPECT_EQ(dir.list().size(), 0u);
}

TEST(MapServerWriter, NothingIsReplacedUnasked) {
  const testing::TempDir dir;
  const auto source = open(map_server(), save_map(dir, {}, p5({0, 205, 254, 7, 200, 255})));
  for (const char* existing : {"out.yaml", "out.pgm"}) {
    testing::write_text(dir / existing, "old");
    const std::size_t files = dir.list().size();
    EXPECT_EQ(testing::error_of([&] { write(map_server(), *source, dir / "out.yaml"); }).code(),
              ErrorCode::kOutput);
    EXPECT_EQ(testing::read_text(dir / existing), "old");
    EXPECT_EQ(dir.list().size(), files);
    std::filesystem::remove(dir / existing);
  }
  testing::write_text(dir / "out.yaml", "old");
  write(map_server(), *source, dir / "out.yaml", {}, nullptr, "", true);
  EXPECT_NE(testing::read_text(dir / "out.yaml"), "old");
}

TEST(MapServerWriter, OnlyTheMapsOwnPictureIsReplaced) {
  const testing::TempDir dir;
  const auto source = open(map_server(), save_map(dir, {}, p5({0, 205, 254, 7, 200, 255})));
  testing::write_text(dir / "out.pgm", "another's");
  const auto refused = [&] {
    const Error error =
        testing::error_of([&] { write(map_server(), *source, dir / "out.yaml", {}, nullptr, "", true); });
    EXPECT_EQ(error.code(), ErrorCode::kOutput);
    EXPECT_THAT(error.message(), HasSubstr("out.pgm"));
    EXPECT_FALSE(error.hint().empty());
    EXPECT_EQ(testing::read_text(dir / "out.pgm"), "another's");
  };
  refused();
  for (const char* yaml : {"old", "image: [", "image: a.pgm\n", "image: gone.pgm\n"}) {
    testing::write_text(dir / "out.yaml", yaml);
    refused();
    EXPECT_EQ(testing::read_text(dir / "out.yaml"), yaml);
  }
  testing::write_text(dir / "out.yaml", "image: out.pgm\n");
  write(map_server(), *source, dir / "out.yaml", {}, nullptr, "", true);
  EXPECT_NE(testing::read_text(dir / "out.pgm"), "another's");
  write(map_server(), *source, dir / "out.yaml", {}, nullptr, "", true);
}

TEST(MapServerWriter, NoPictureAppearsIfTheYamlCannotBeWritten) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  const testing::TempDir dir;
  const auto source = open(map_server(), save_map(dir, {}, p5({0, 205, 254, 7, 200, 255})));
  std::filesystem::create_symlink("/dev/full", dir / "out.yaml");
  EXPECT_EQ(testing::error_of([&] {
              write(map_server(), *source, dir / "out.yaml", {}, nullptr, "", true);
            }).code(),
            ErrorCode::kOutput);
  EXPECT_FALSE(std::filesystem::exists(dir / "out.pgm"));
}

TEST(MapServerWriter, ListsWhatItReadsAndWrites) {
  const testing::TempDir dir;
  const std::string path = save_map(dir, {}, p5({0, 205, 254, 7, 200, 255}));
  EXPECT_THAT(map_server().files_read(path), ElementsAre(path, dir / "a.pgm"));
  EXPECT_THAT(map_server().files_read(dir / "gone.yaml"), ElementsAre(dir / "gone.yaml"));
  WriteRequest request;
  request.path = dir / "out.yaml";
  EXPECT_THAT(map_server().files_written({}, request), ElementsAre(dir / "out.yaml", dir / "out.pgm"));
  request.settings = {{"mode", "scale"}};
  EXPECT_THAT(map_server().files_written({}, request), ElementsAre(dir / "out.yaml", dir / "out.png"));
}

TEST(MapServerWriter, RefusesWhatItCannotDo) {
  const testing::TempDir dir;
  const auto source = open(map_server(), save_map(dir, {}, p5({0, 205, 254, 7, 200, 255})));
  const auto code = [&](const std::string& name, const Settings& settings, const std::string& layer = "") {
    return testing::error_of([&] { write(map_server(), *source, dir / name, settings, nullptr, layer); })
        .code();
  };
  EXPECT_EQ(code("out.pgm", {}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code("out.yaml", {{"mode", "scale"}, {"image", "pgm"}}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code("out.yaml", {{"occupied_thresh", "1"}}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code("out.yaml", {{"occupied_thresh", "2"}}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code("out.yaml", {{"occupied_thresh", "0.3"}, {"free_thresh", "0.4"}}),
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(code("out.yaml", {{"image", "bmp"}}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code("out.yaml", {{"datum", "0,0"}}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code("out.yaml", {}, "nothing"), ErrorCode::kInvalidArgument);
  EXPECT_EQ(dir.list().size(), 2u);
}

}  // namespace
}  // namespace apgm::converters

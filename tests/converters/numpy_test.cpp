#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <stdexcept>

#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"
#include "converters/numpy/numpy.hpp"
#include "random_map.hpp"
#include "tests/converters/support.hpp"

namespace apgm::converters {
namespace {

using testing::collect;
using ::testing::ElementsAre;
using testing::error_of;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::open;
using ::testing::SizeIs;
using testing::write;

std::string content_id(const PatchSource& source) {
  const testing::TempDir dir;
  Writer writer(dir / "a.apgm", source.header());
  copy(source, source.header().types, writer, true);
  writer.finish();
  return writer.report().content_id;
}

test::RandomMapOptions site() {
  test::RandomMapOptions options;
  options.frame.frame_id = "site \"A\"";
  options.frame.epsg = 32632;
  options.frame.edge_um = 12'345'678;
  options.frame.datum_x_um = 569'974'400'001;
  options.frame.datum_y_um = -5'359'961'600'003;
  return options;
}

/// What a Python program prints; nullopt without NumPy.
std::optional<std::string> python(const std::string& program) {
  const testing::TempDir dir;
  const std::string path = testing::write_text(dir / "a.py", program);
  for (const char* interpreter : {"python3", "/usr/bin/python3"}) {
    const std::string command =
        std::string(interpreter) + " -c 'import numpy' 2>/dev/null && " + interpreter + " " + path;
    FILE* pipe = ::popen(command.c_str(), "r");
    std::string text;
    std::array<char, 4096> buffer;
    for (std::size_t n = 0; (n = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;)
      text.append(buffer.data(), n);
    if (::pclose(pipe) == 0) return text;
  }
  return {};
}

TEST(Numpy, ArchivesKeepTheContentOfAllLayersAndSteps) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    auto options = site();
    LayerType low = LayerType::occupancy("low");
    low.slab = Slab{-500'000, 1'000'000};
    options.types.push_back(low);
    Map map = test::random_map(seed, options);
    map.set_stamp_ns(1'700'000'000'000'000'123);
    for (const char* compression : {"deflate", "none"}) {
      const testing::TempDir dir;
      testing::Collected findings;
      write(numpy(), map, dir / "a.npz", {{"compression", compression}}, &findings);
      const auto source = open(numpy(), dir / "a.npz", {}, &findings);
      EXPECT_THAT(findings.list, IsEmpty());
      EXPECT_EQ(content_id(map), content_id(*source));
      EXPECT_EQ(test::difference(map, collect(*source)), "");
      EXPECT_EQ(source->header().frame, map.header().frame);
      EXPECT_EQ(source->header().stamp_ns, map.header().stamp_ns);
      write(numpy(), map, dir / "b.npz", {{"compression", compression}});
      EXPECT_TRUE(testing::read_text(dir / "a.npz") == testing::read_text(dir / "b.npz"));
      const std::string head = testing::read_text(dir / "a.npz").substr(0, 4096);
      EXPECT_TRUE(numpy().sniffs("a", std::as_bytes(std::span(head))));
    }
  }
}

TEST(Numpy, OneLayerIsAnArrayWithJsonBeside) {
  auto options = site();
  options.types = {LayerType::semantic("semantic", {"road", "marking"})};
  options.min_step = options.max_step = 4;
  const Map map = test::random_map(9, options);
  const testing::TempDir dir;
  write(numpy(), map, dir / "a.npy");
  EXPECT_EQ(content_id(map), content_id(*open(numpy(), dir / "a.npy")));
  EXPECT_THAT(numpy().files_read(dir / "a.npy"), ElementsAre(dir / "a.npy", dir / "a.json"));
  EXPECT_EQ(error_of([&] { write(numpy(), map, dir / "a.npy"); }).code(), ErrorCode::kOutput);
  std::filesystem::remove(dir / "a.json");
  EXPECT_THAT(error_of([&] { open(numpy(), dir / "a.npy"); }).message(),
              HasSubstr("which says what it means"));
  const Map several = test::random_map(9);
  EXPECT_THAT(error_of([&] { write(numpy(), several, dir / "b.npy"); }).hint(), HasSubstr("--layer"));
  EXPECT_EQ(error_of([&] { write(numpy(), several, dir / "b.txt"); }).code(), ErrorCode::kInvalidArgument);
}

TEST(Numpy, OneStepMergesAndSplits) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy(), LayerType::real("height", {"z"})});
  Map map(header);
  map.layer({0, 0}, 1, 4).at(0, {1, 1}) = 0.75f;
  map.layer({1, 0}, 1, 2).at(0, {1, 1}) = 0.75f;
  map.layer({1, 0}, 0, 2).at(0, {1, 1}) = 5;
  const testing::TempDir dir;
  testing::Collected findings;
  write(numpy(), map, dir / "a.npz", {{"step", "3"}}, &findings, "occupancy");
  EXPECT_THAT(findings.losses(), ElementsAre("1 layers of coarser cells are split to step 3",
                                             "1 layers of finer cells are merged to step 3",
                                             "layer 'height' is left out: 1 patches"));
  WriteRequest request;
  request.path = dir / "b.npz";
  request.settings = {{"step", "3"}};
  request.run.findings = [](const Finding&) { throw std::runtime_error("refused"); };
  EXPECT_THROW(numpy().write(map, request), std::runtime_error);
  EXPECT_FALSE(std::filesystem::exists(dir / "b.npz"));
  const Map back = collect(*open(numpy(), dir / "a.npz"));
  EXPECT_EQ(back.find({0, 0}, 0)->at(0, {0, 0}), 0.75f);
  EXPECT_EQ(back.find({1, 0}, 0)->step(), 3);
}

TEST(Numpy, EmptyMaps) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  const Map map(header);
  const testing::TempDir dir;
  write(numpy(), map, dir / "a.npz");
  EXPECT_EQ(content_id(map), content_id(*open(numpy(), dir / "a.npz")));
}

TEST(Numpy, AnotherGridIsRegriddedAndSaid) {
  auto options = site();
  options.types = {LayerType::occupancy()};
  const Map map = test::random_map(9, options);
  const testing::TempDir dir;
  write(numpy(), map, dir / "a.npz");
  testing::Collected findings;
  const auto source =
      open(numpy(), dir / "a.npz", {{"edge_m", "10"}, {"frame_id", "other"}, {"epsg", "25832"}}, &findings);
  EXPECT_EQ(source->header().frame.edge_um, 10'000'000);
  EXPECT_EQ(source->header().frame.frame_id, "other");
  EXPECT_EQ(source->header().frame.epsg, 25832);
  EXPECT_THAT(findings.losses(), ElementsAre(HasSubstr("regridded")));
}

TEST(Numpy, PythonReadsWhatIsWritten) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  map.layer({-1, 2}, 0, 3).at(0, {1, 2}) = 0.5f;
  map.layer({0, 3}, 0, 3).at(1, {4, 5}) = 0.25f;
  const testing::TempDir dir;
  write(numpy(), map, dir / "a.npz");
  write(numpy(), map, dir / "a.npy");
  const auto text =
      python("import json, numpy\nz = numpy.load('" + (dir / "a.npz") +
             "')\na = z['occupancy']\nm = json.loads(z['meta.json'])\nl = m['layers'][0]\n"
             "print(a.dtype, a.shape, float(a[0, 2, 1]), float(a[1, 8 + 5, 8 + 4]), float(a.sum()))\n"
             "print(l['first_cell'], l['channels'], round(l['cell_m'], 3), l['corner_m'], m['axes'][1])\n"
             "b = numpy.load('" +
             (dir / "a.npy") + "')\nprint((a == b).all())\n");
  if (!text) GTEST_SKIP() << "Python has no NumPy";
  EXPECT_EQ(
      *text,
      "float32 (2, 16, 16) 0.5 0.25 0.75\n[-8, 16] ['O', 'F'] 1.6 [-12.8, 25.6] row from south\nTrue\n");
}

/// A meta.json for a layer `v` with one real channel, cells of 0.1 m.
std::string json(const std::string& array, const std::string& more = "") {
  return R"({"format": "apgm.numpy/1", "frame": {"frame_id": "map", "epsg": null, "edge_um": 12800000,
  "datum_um": [0, 0]}, "layers": [{"array": ")" +
         array + R"(", "layer": "v", "hypotheses": [], "channels": ["x"],
  "policy": "mean", "step": 7, "first_cell": [-2, 5])" +
         more + "}]}";
}

TEST(Numpy, ReadsWhatPythonWrites) {
  const testing::TempDir dir;
  testing::write_text(dir / "meta.json", json("v.npy"));
  const auto text = python(
      "import numpy, zipfile\na = numpy.arange(12.0).reshape(3, 4)\na[0, 0] = numpy.nan\na[2, 3] = 0.1\n"
      "numpy.savez_compressed('" +
      (dir / "a.npz") +
      "', v=a)\n"
      "zipfile.ZipFile('" +
      (dir / "a.npz") + "', 'a').write('" + (dir / "meta.json") + "', 'meta.json')\n");
  if (!text) GTEST_SKIP() << "Python has no NumPy";
  testing::Collected findings;
  const Map map = collect(*open(numpy(), dir / "a.npz", {}, &findings));
  EXPECT_THAT(findings.losses(), ElementsAre("1 value is rounded to float32"));
  ASSERT_EQ(map.size(), 2u);
  EXPECT_TRUE(std::isnan(map.find({-1, 0}, 0)->at(0, {126, 5})));
  EXPECT_EQ(map.find({-1, 0}, 0)->at(0, {127, 5}), 1.0f);
  EXPECT_EQ(map.find({0, 0}, 0)->at(0, {0, 6}), 6.0f);
  EXPECT_EQ(map.find({0, 0}, 0)->at(0, {1, 7}), 0.1f);
}

class NumpyBadInput : public ::testing::Test {
 protected:
  /// An .npy of `head` and floats.
  std::string npy(const std::string& dict, const std::vector<float>& values, char major = 1) const {
    std::string bytes = std::string("\x93NUMPY") + major + '\0';
    bytes += {static_cast<char>(dict.size() & 0xff), static_cast<char>(dict.size() >> 8)};
    if (major > 1) bytes += {'\0', '\0'};
    return bytes + dict + std::string(reinterpret_cast<const char*>(values.data()), values.size() * 4);
  }
  Error refused(const std::string& bytes, const std::string& meta) {
    testing::write_text(dir_ / "a.npy", bytes);
    testing::write_text(dir_ / "a.json", meta);
    return error_of([&] { open(numpy(), dir_ / "a.npy"); });
  }
  void expect(const Error& error, ErrorCode code, const std::string& message) {
    EXPECT_EQ(error.code(), code) << error.message();
    EXPECT_THAT(error.message(), HasSubstr(message));
    EXPECT_NE(error.path(), "");
    EXPECT_NE(error.hint(), "") << error.message();
  }
  std::string dict(const std::string& shape, const std::string& descr = "<f4",
                   const std::string& fortran = "False") const {
    return "{'descr': '" + descr + "', 'fortran_order': " + fortran + ", 'shape': " + shape + ", }\n";
  }
  testing::TempDir dir_;
};

TEST_F(NumpyBadInput, Headers) {
  const std::string meta = json("a.npy");
  const std::vector<float> four{1, 2, 3, 4};
  testing::write_text(dir_ / "a.npy", npy(dict("(1, 2, 2)"), four));
  testing::write_text(dir_ / "a.json", meta);
  EXPECT_EQ(open(numpy(), dir_ / "a.npy")->summary().patches, 1u);
  testing::write_text(dir_ / "a.npy",
                      npy("{\"shape\":(2,2),\"descr\":\"<f4\",\"fortran_order\":False}", four, 2));
  EXPECT_EQ(open(numpy(), dir_ / "a.npy")->summary().patches, 1u);
  expect(refused("x", meta), ErrorCode::kForeign, "no .npy file");
  expect(refused(npy(dict("(1, 2, 2)"), four, 4), meta), ErrorCode::kUnsupported, "format is 4");
  expect(refused(npy(dict("(1, 2, 2)", ">f4"), four), meta), ErrorCode::kUnsupported, "values are '>f4'");
  expect(refused(npy(dict("(1, 2, 2)", "|O"), four), meta), ErrorCode::kUnsupported, "values are '|O'");
  expect(refused(npy(dict("(1, 2, 2)", "<f4", "True"), four), meta), ErrorCode::kUnsupported, "Fortran");
  expect(refused(npy(dict("(1, 2, 3)"), four), meta), ErrorCode::kDamaged, "ends before");
  expect(refused(npy(dict("(1, 1, 2)"), four), meta), ErrorCode::kDamaged, "goes on after");
  expect(refused(npy(dict("(4,)"), four), meta), ErrorCode::kDamaged,
         "does not have the shape (1, rows, columns)");
  expect(refused(npy(dict("(2, 2, 1)"), four), meta), ErrorCode::kDamaged, "does not have the shape");
  expect(refused(npy(dict("(1, 0, 2)"), {}), meta), ErrorCode::kUnsupported, "no values");
  expect(refused(npy(dict("()"), four), meta), ErrorCode::kUnsupported, "no axes");
  expect(refused(npy(dict("(1, 1099511627776, 1099511627776)"), four), meta), ErrorCode::kLimit, "2^40");
  expect(refused(npy(dict("(1, 1048576, 1048576)"), four), meta), ErrorCode::kLimit,
         "more than memory is given");
  expect(refused(npy(dict("(1, 10000, 10000)"), four), meta), ErrorCode::kDamaged, "ends before");
  for (const char* bad : {"{'descr': '<f4'}", "{'descr': '<f4', 'fortran_order': False, 'shape': (1, -2, 2)}",
                          "{", "", "{'descr': '<f4', 'fortran_order': 0, 'shape': (1, 2, 2)}",
                          "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2, 2), 'x': 1}",
                          "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2, 2)} + 1", "[1]"}) {
    const Error error = refused(npy(bad, four), meta);
    EXPECT_TRUE(error.code() == ErrorCode::kDamaged || error.code() == ErrorCode::kUnsupported) << bad;
  }
}

TEST_F(NumpyBadInput, Json) {
  const std::string array = npy(dict("(1, 2, 2)"), {1, 2, 3, 4});
  const std::string good = json("a.npy");
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return refused(array, text.replace(at, from.size(), to));
  };
  expect(refused(array, "{"), ErrorCode::kForeign, "not that of a map");
  expect(refused(array, "[]"), ErrorCode::kForeign, "not that of a map");
  expect(with("numpy/1", "numpy/2"), ErrorCode::kUnsupported, "'apgm.numpy/2'");
  expect(with("\"step\": 7", "\"step\": 12"), ErrorCode::kDamaged, "'step'");
  expect(with("\"step\": 7", "\"step\": 18446744073709551615"), ErrorCode::kDamaged, "'step'");
  expect(with("\"step\": 7", "\"step\": 7.5"), ErrorCode::kDamaged, "'step'");
  expect(with("12800000", "5"), ErrorCode::kDamaged, "its JSON");
  for (const char* code : {"-1", "0", "1000000", "1.5", "18446744073709551615", "true", "\"4326\""}) {
    const Error error = with("null", code);
    expect(error, ErrorCode::kDamaged, "'epsg' is no whole number in 1..999999 and not null");
    EXPECT_THAT(error.hint(), HasSubstr("no 'epsg'"));
  }
  expect(with("[-2, 5]", "[-2]"), ErrorCode::kDamaged, "'first_cell'");
  expect(with("[-2, 5]", "[9223372036854775807, 5]"), ErrorCode::kDamaged, "'first_cell'");
  expect(with("[-2, 5]", "[8796093022208, 5]"), ErrorCode::kLimit, "outside all patch indices");
  expect(with("\"mean\"", "\"best\""), ErrorCode::kDamaged, "'policy'");
  expect(with("[\"x\"]", "[1]"), ErrorCode::kDamaged, "'channels'");
  expect(with("\"layer\": \"v\"", "\"layer\": \"a b\""), ErrorCode::kDamaged, "name");
  expect(with("\"frame\"", "\"farm\""), ErrorCode::kDamaged, "'frame' is missing");
}

TEST_F(NumpyBadInput, ValuesNameTheirPlace) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const std::string values = json("a.npy");
  std::string masses = values;
  masses.replace(masses.find("\"hypotheses\": []"), 16, "\"hypotheses\": [\"O\", \"F\"]");
  masses.replace(masses.find("[\"x\"]"), 5, "[\"O\", \"F\"]");
  const std::string shape = dict("(2, 1, 2)");
  expect(refused(npy(shape, {0, 0, 0, 1.5}), masses), ErrorCode::kDamaged,
         "array 'a.npy' at [1, 0, 1]: 1.5 is no mass");
  expect(refused(npy(shape, {0, nan, 0, 0}), masses), ErrorCode::kDamaged, "at [0, 0, 1]: nan is no mass");
  expect(refused(npy(shape, {0, 0, -1, 0}), masses), ErrorCode::kDamaged, "at [1, 0, 0]: -1 is no mass");
  expect(refused(npy(shape, {0, .75f, 0, .5f}), masses), ErrorCode::kDamaged, "the masses sum to 1.25");
  expect(refused(npy(dict("(1, 2, 1)"), {0, inf}), values), ErrorCode::kDamaged,
         "at [0, 1, 0]: an infinite value");
}

TEST_F(NumpyBadInput, DamagedArchivesFailOrReadButNeverCrash) {
  auto options = site();
  options.range = {{0, 0}, {1, 1}};
  const Map map = test::random_map(4, options);
  for (const char* compression : {"deflate", "none"}) {
    write(numpy(), map, dir_ / "a.npz", {{"compression", compression}}, nullptr, "", true);
    const std::string whole = testing::read_text(dir_ / "a.npz");
    test::Random random(20);
    for (int round = 0; round < 200; ++round) {
      SCOPED_TRACE("round " + std::to_string(round));
      std::string bytes = whole;
      if (round % 2 == 0)
        bytes.resize(static_cast<std::size_t>(random.below(static_cast<int>(bytes.size()))));
      const auto at = static_cast<std::size_t>(random.below(static_cast<int>(bytes.size()) + 1));
      if (round % 2 == 1 && at < bytes.size())
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << random.below(8)));
      testing::write_text(dir_ / "b.npz", bytes);
      try {
        EXPECT_EQ(content_id(*open(numpy(), dir_ / "b.npz")), content_id(map));
      } catch (const Error& error) {
        EXPECT_NE(error.message(), "");
      }
    }
  }
}

TEST(Numpy, WithoutAnEpsgCodeThereIsNone) {
  const testing::TempDir dir;
  LayerType type = LayerType::real("v", {"x"});
  MapHeader header;
  header.types = TypeTable({type});
  Map map(header);
  map.layer({0, 0}, 0, 2).at(0, {1, 1}) = 5;
  write(numpy(), map, dir / "a.npy");
  for (const std::string epsg : {"\"epsg\": null,", "", "\"epsg\": 32632,"}) {
    std::string text = testing::read_text(dir / "a.json");
    const std::size_t at = text.find("\"epsg\": null,");
    ASSERT_NE(at, std::string::npos) << text;
    std::filesystem::copy_file(dir / "a.npy", dir / "b.npy",
                               std::filesystem::copy_options::overwrite_existing);
    testing::write_text(dir / "b.json", text.replace(at, 13, epsg));
    const auto found = open(numpy(), dir / "b.npy")->header().frame.epsg;
    EXPECT_EQ(found.value_or(0), epsg.ends_with("32632,") ? 32632 : 0);
  }
}

TEST(Numpy, AnArchiveWithoutLayersIsNoted) {
  MapHeader header;
  const testing::TempDir dir;
  write(numpy(), Map(header), dir / "a.npz");
  testing::Collected findings;
  EXPECT_EQ(open(numpy(), dir / "a.npz", {}, &findings)->summary().patches, 0u);
  EXPECT_THAT(findings.of(Finding::Kind::kNote), ElementsAre("the JSON names no layers: the map is empty"));
}

TEST_F(NumpyBadInput, NoArchiveHasAHint) {
  testing::write_text(dir_ / "a.npz", "PK, but no archive");
  expect(error_of([&] { open(numpy(), dir_ / "a.npz"); }), ErrorCode::kDamaged,
         "no archive that can be read");
}

TEST_F(NumpyBadInput, ASmallFileIsNotUnpackedWithoutBound) {
  // 260 patches of 2^10 x 2^10 cells, in two of which something is known: 1040 MiB, a few MiB deflated.
  MapHeader header;
  header.types = TypeTable({LayerType::real("v", {"x"}, Policy::kSum)});
  Map map(header);
  map.layer({0, 0}, 0, 10).at(0, {1, 1}) = 5;
  map.layer({259, 0}, 0, 10).at(0, {1, 1}) = 5;
  write(numpy(), map, dir_ / "a.npz");
  EXPECT_LT(std::filesystem::file_size(dir_ / "a.npz"), 4u << 20);
  const Error error = error_of([&] { open(numpy(), dir_ / "a.npz"); });
  expect(error, ErrorCode::kLimit, "272629760 values, more than memory is given");
  EXPECT_THAT(error.hint(), HasSubstr("allow at least 1040 MiB, or cut the array"));
}

TEST_F(NumpyBadInput, MemoryIsBounded) {
  auto options = site();
  options.types = {LayerType::occupancy()};
  write(numpy(), test::random_map(3, options), dir_ / "a.npz");
  const Error error = error_of([&] { numpy().open({dir_ / "a.npz", {}, {}, 1000}); });
  expect(error, ErrorCode::kLimit, "more than memory is given");
}

}  // namespace
}  // namespace apgm::converters

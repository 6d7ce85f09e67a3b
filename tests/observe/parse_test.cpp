#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <locale>
#include <random>
#include <sstream>

#include "apgm/core/error.hpp"
#include "apgm/observe/model.hpp"
#include "apgm/observe/profile.hpp"

namespace apgm {
namespace {

using ::testing::HasSubstr;

/// The YAML blocks of docs/observe.md.
std::vector<std::string> documented_examples() {
  std::ifstream file(std::string(APGM_DOCS_DIR) + "/observe.md");
  std::ostringstream whole;
  whole << file.rdbuf();
  const std::string text = whole.str();
  std::vector<std::string> blocks;
  for (std::size_t at = text.find("```yaml\n"); at != std::string::npos;
       at = text.find("```yaml\n", at + 1)) {
    const std::size_t begin = at + 8;
    blocks.push_back(text.substr(begin, text.find("```", begin) - begin));
  }
  return blocks;
}

template <class Parse>
Error error_of(Parse parse) {
  try {
    parse();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_EQ(error.path(), "x.yaml");
    return error;
  }
  ADD_FAILURE() << "no error";
  return {ErrorCode::kCancelled, ""};
}
Error models_error(std::string_view yaml) {
  return error_of([&] { parse_models(yaml, "x.yaml"); });
}
Error profiles_error(std::string_view yaml) {
  return error_of([&] { parse_profiles(yaml, "x.yaml"); });
}

TEST(ParseModelsTest, ReadsTheDocumentedExample) {
  const Models models = parse_models(documented_examples().at(0), "models.yaml");
  EXPECT_EQ(models.kind, ModelKind::kRichter);
  EXPECT_EQ(models.limits.min_range_m, 1.5);
  EXPECT_EQ(models.limits.max_range_m, 100);
  EXPECT_EQ(models.limits.z_min_m, 0.3);
  EXPECT_EQ(models.limits.z_max_m, 2.5);
  EXPECT_EQ(models.nuss, NussModel{});
  EXPECT_EQ(models.classes.size(), 3u);
}

TEST(ParseModelsTest, AbsentKeysKeepTheirDefaults) {
  const Models models = parse_models("nuss: {sigma_m: 2e-1}\nclasses: [a, b]", "x.yaml");
  EXPECT_EQ(models.nuss, (NussModel{.sigma_m = 0.2}));
  EXPECT_EQ(models.richter, RichterModel{});
  EXPECT_EQ(models.camera, CameraModel{});
  EXPECT_EQ(models.classes, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(parse_models("{}", "x.yaml").nuss, NussModel{});
}

TEST(ParseModelsTest, UnknownKeysNameLineAndNeighbour) {
  const Error error = models_error("model: nuss\nnuss:\n  occ_max: 0.5\n  sigma: 0.1\n");
  EXPECT_EQ(error.message(), "'x.yaml' line 4: key 'sigma' of 'nuss' is unknown");
  EXPECT_EQ(error.hint(), "did you mean 'sigma_m'? known keys: occ_max, sigma_m, free_max, free_range_m");
  EXPECT_THAT(models_error("mdoel: nuss").hint(), HasSubstr("did you mean 'model'?"));
  EXPECT_THAT(models_error("quite_something_else: 1").hint(), ::testing::StartsWith("known keys: model,"));
}

TEST(ParseModelsTest, RefusesWrongTypesAndNumbersThatAreNone) {
  for (const char* value :
       {"fast", "'0.5'", "[0.5]", "{a: 1}", ".nan", "nan", ".inf", "inf", "0x1p-1", "0,5", "0.5m", "1e999"}) {
    const Error error = models_error("nuss:\n  occ_max: " + std::string(value));
    EXPECT_THAT(error.message(), HasSubstr("line 2: key 'occ_max' of 'nuss' is")) << value;
    EXPECT_EQ(error.hint(), "'occ_max' lies in [0, 1)") << value;
  }
  EXPECT_THAT(models_error("nuss: 3").message(), HasSubstr("key 'nuss' holds no keys"));
  EXPECT_THAT(models_error("nuss:").message(), HasSubstr("key 'nuss' has no value"));
  EXPECT_THAT(models_error("model: {}").message(), HasSubstr("key 'model' is not a text"));
  EXPECT_THAT(models_error("classes: Road").message(), HasSubstr("key 'classes' is not a list"));
  EXPECT_THAT(models_error("model: elfes").hint(), HasSubstr("nuss or richter"));
}

TEST(ParseModelsTest, RefusesValuesOutOfRange) {
  const auto refused = [](const std::string& section, const std::string& pair) {
    EXPECT_THAT(models_error(section + ": {" + pair + "}").message(), HasSubstr("out of range")) << pair;
  };
  refused("nuss", "occ_max: 1");
  refused("nuss", "occ_max: -0.1");
  refused("nuss", "sigma_m: 0");
  refused("nuss", "free_max: 1.5");
  refused("nuss", "free_range_m: 10001");
  refused("richter", "p_fn: 0");
  refused("richter", "p_fp: 1");
  refused("limits", "min_range_m: -1");
  refused("limits", "max_range_m: 1e5");
  refused("limits", "no_return_clears_m: -1");
  refused("camera", "rho: 0");
  EXPECT_THAT(models_error("limits: {z_min_m: 3, z_max_m: 3}").message(), HasSubstr("not below z_max_m"));
  EXPECT_THAT(models_error("limits: {min_range_m: 90}").message(), HasSubstr("not below max_range_m"));
  EXPECT_THAT(models_error("classes: [one]").message(), HasSubstr("x.yaml"));
  EXPECT_THAT(models_error("classes: [a, b, a]").message(), HasSubstr("names 'a' twice"));
  EXPECT_THAT(models_error("occupancy_layer: 'a b'").message(), HasSubstr("x.yaml"));
  EXPECT_THAT(models_error("occupancy_layer: semantics").message(), HasSubstr("same layer"));
}

TEST(ParseModelsTest, ChecksModelsThatWereBuiltInCode) {
  Models models;
  models.nuss.occ_max = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(models.check(), Error);
  EXPECT_THROW(Observer({}, models), Error);
}

TEST(ParseModelsTest, RefusesDuplicatesAliasesTagsAndDepth) {
  EXPECT_THAT(models_error("model: nuss\nmodel: richter").message(),
              HasSubstr("line 2: key 'model' is given twice"));
  EXPECT_THAT(models_error("nuss: &a {occ_max: 0.5}").message(), HasSubstr("anchors and aliases"));
  EXPECT_THAT(models_error("a: &a [x,x]\nb: &b [*a,*a]\nc: [*b,*b]").message(),
              HasSubstr("anchors and aliases"));
  EXPECT_THAT(models_error("model: !!binary abc").message(), HasSubstr("tags"));
  EXPECT_THAT(models_error("model: nuss\n---\nmodel: nuss").message(), HasSubstr("second document"));
  EXPECT_THAT(models_error(std::string(100'000, '[')).message(), HasSubstr("nested too deep"));
  EXPECT_THAT(models_error("model: " + std::string(1 << 20, 'x')).message(), HasSubstr("1 MiB"));
  EXPECT_THAT(models_error("model: " + std::string(5'000, 'x')).message(),
              HasSubstr("longer than 255 bytes"));
}

TEST(ParseModelsTest, RefusesWhatIsNoYamlOrNoText) {
  EXPECT_THAT(models_error("model: nuss\n\tnuss: [").message(), HasSubstr("line 2: not valid YAML"));
  EXPECT_THAT(models_error("model: n\xff").message(), HasSubstr("not UTF-8"));
  EXPECT_THAT(models_error(std::string_view("model\0: x", 9)).message(), HasSubstr("not UTF-8"));
  EXPECT_THAT(models_error("").message(), HasSubstr("holds no keys"));
  EXPECT_THAT(models_error("just words").message(), HasSubstr("holds no keys"));
  EXPECT_THAT(models_error("? [a, b]\n: 1").message(), HasSubstr("is unknown"));
  EXPECT_THAT(models_error("\"a\\x1b[31m\": 1").message(), HasSubstr("key 'a?[31m' is unknown"));
}

TEST(ParseModelsTest, ReadsTheSameInEveryLocale) {
  struct Comma : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\1"; }
  };
  const std::locale before = std::locale::global(std::locale(std::locale(), new Comma));
  const Models models = parse_models("nuss: {occ_max: 0.25, free_range_m: 1234.5}", "x.yaml");
  std::locale::global(before);
  EXPECT_EQ(models.nuss.occ_max, 0.25);
  EXPECT_EQ(models.nuss.free_range_m, 1234.5);
}

TEST(ParseProfilesTest, ReadsTheDocumentedExample) {
  const Schedule schedule = parse_profiles(documented_examples().at(1), "profiles.yaml");
  ASSERT_EQ(schedule.entries.size(), 3u);
  EXPECT_EQ(schedule.at(0).name, "parking");
  EXPECT_EQ(schedule.at(155.9).name, "parking");
  EXPECT_EQ(schedule.at(156).name, "road");
  EXPECT_EQ(schedule.at(1e9).name, "parking again");
  EXPECT_EQ(schedule.at(-1).name, "parking");
  const auto& road = schedule.entries[1].profile.requirements;
  ASSERT_EQ(road.size(), 4u);
  EXPECT_EQ(road[1].cell_m, 0.4);
  EXPECT_EQ(std::get<Ring>(road[1].area), (Ring{60, 100}));
  EXPECT_EQ(std::get<Polygon>(road[3].area).rings.at(0).at(2), (Point{42.5, 4}));
  const TypeTable types({Models{}.occupancy_type(), Models{}.semantic_type()});
  for (const auto& entry : schedule.entries) EXPECT_NO_THROW(entry.profile.check({}, types));
}

TEST(ParseTest, RandomDamageGivesAnErrorOrAValue) {
  const std::vector<std::string> examples = documented_examples();
  ASSERT_EQ(examples.size(), 2u);
  std::mt19937_64 random(1);
  int refused = 0;
  constexpr int kTexts = 4'000;
  constexpr std::string_view kSyntax = "{}[]:,-?&*!|>'\"%@`#\n \t~<.0x\xff";
  for (int i = 0; i < kTexts; ++i) {
    std::string text = examples[random() % 2];
    for (auto edits = 1 + random() % 4; edits > 0; --edits) {
      const std::size_t at = random() % text.size();
      switch (random() % 3) {
        case 0:
          text[at] = kSyntax[random() % kSyntax.size()];
          break;
        case 1:
          text.insert(at, text, random() % text.size(), random() % 20);
          break;
        default:
          text.erase(at, random() % 20);
          text += ' ';
      }
    }
    try {
      parse_models(text, "x.yaml");
    } catch (const Error& error) {
      ASSERT_EQ(error.code(), ErrorCode::kInvalidArgument) << text;
    }
    try {
      parse_profiles(text, "x.yaml");
    } catch (const Error& error) {
      ASSERT_EQ(error.code(), ErrorCode::kInvalidArgument) << text;
      ++refused;
    }
  }
  EXPECT_GT(refused, kTexts / 2);
  EXPECT_LT(refused, kTexts);
}

TEST(ParseProfilesTest, ReadsASingleProfile) {
  const Schedule schedule =
      parse_profiles("name: p\nrequirements:\n- {layer: occupancy, horizon_m: 20, cell_m: 0.1}", "x.yaml");
  ASSERT_EQ(schedule.entries.size(), 1u);
  EXPECT_EQ(schedule.entries[0].profile.name, "p");
  EXPECT_EQ(std::get<Ring>(schedule.at(5).requirements.at(0).area), (Ring{0, 20}));
}

TEST(ParseProfilesTest, ReadsPolygonsWithHoles) {
  const Schedule schedule = parse_profiles(
      "requirements: [{layer: a, cell_m: 1, polygon: [[[0,0],[9,0],[9,9]], [[5,1],[6,1],[6,2]]]}]", "x.yaml");
  EXPECT_EQ(std::get<Polygon>(schedule.at(0).requirements.at(0).area).rings.size(), 2u);
}

TEST(ParseProfilesTest, RefusesWhatDoesNotFitTogether) {
  const auto message = [](const std::string& requirement) {
    return profiles_error("requirements:\n- " + requirement).message();
  };
  EXPECT_THAT(message("{horizon_m: 1, cell_m: 1}"), HasSubstr("has no key 'layer'"));
  EXPECT_THAT(message("{layer: a, horizon_m: 1}"), HasSubstr("has no key 'cell_m'"));
  EXPECT_THAT(message("{layer: a, cell_m: 1}"), HasSubstr("exactly one of"));
  EXPECT_THAT(message("{layer: a, cell_m: 1, horizon_m: 1, polygon: [[0,0],[1,0],[1,1]]}"),
              HasSubstr("exactly one of"));
  EXPECT_THAT(message("{layer: a, horizon_m: -1, cell_m: 1}"), HasSubstr("line 2: key 'horizon_m'"));
  EXPECT_THAT(message("{layer: a, horizon_m: 1, cell_m: 0}"), HasSubstr("out of range"));
  EXPECT_THAT(message("{layer: a, horizon: 1, cell_m: 1}"),
              HasSubstr("key 'horizon' of entry 1 of key 'requirements' is unknown"));
  EXPECT_THAT(message("{layer: a, cell_m: 1, bands: []}"), HasSubstr("has bands and a cell_m"));
  EXPECT_THAT(message("{layer: a, bands: []}"), HasSubstr("is empty"));
  EXPECT_THAT(message("{layer: a, bands: [{from_m: 5, to_m: 5, cell_m: 1}]}"),
              HasSubstr("ends before it begins"));
  EXPECT_THAT(
      message("{layer: a, bands: [{from_m: 0, to_m: 5, cell_m: 1}, {from_m: 4, to_m: 9, cell_m: 1}]}"),
      HasSubstr("begins before the band above it ends"));
  EXPECT_THAT(message("{layer: a, cell_m: 1, polygon: [[0,0],[1,0]]}"), HasSubstr("fewer than 3 corners"));
  EXPECT_THAT(message("{layer: a, cell_m: 1, polygon: [[0,0],[1,0],[1]]}"), HasSubstr("not a pair"));
  EXPECT_THAT(message("{layer: a, cell_m: 1, polygon: [[0,0],[1,0],[1,1e10]]}"), HasSubstr("beyond 1e9 m"));
  EXPECT_THAT(message("{layer: a, cell_m: 1, polygon: []}"), HasSubstr("fewer than 3 corners"));
  EXPECT_THAT(profiles_error("name: a").message(), HasSubstr("has no key 'requirements'"));
  EXPECT_THAT(profiles_error("profiles: []").message(), HasSubstr("is empty"));
  EXPECT_THAT(profiles_error("profiles: [{requirements: []}]\nname: a").message(), HasSubstr("beside"));
}

TEST(ParseProfilesTest, RefusesTimesThatDoNotAscend) {
  EXPECT_THAT(profiles_error("profiles: [{requirements: []}, {requirements: []}]").message(),
              HasSubstr("from_s"));
  EXPECT_THAT(profiles_error("profiles: [{from_s: 1, requirements: []}]").message(), HasSubstr("is not 0"));
  EXPECT_THAT(profiles_error("profiles: [{requirements: []}, {from_s: 0, requirements: []}]").message(),
              HasSubstr("not later"));
}

}  // namespace
}  // namespace apgm

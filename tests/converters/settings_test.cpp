#include "converters/common/settings.hpp"

#include "tests/converters/support.hpp"

namespace apgm::converters {
namespace {

using ::testing::HasSubstr;

class FakeConverter final : public Converter {
 public:
  std::string_view name() const override { return "fake"; }
  std::string_view description() const override { return ""; }
  std::vector<std::string> extensions() const override { return {}; }
  std::vector<SettingSpec> settings() const override {
    return {{"a", "", ""}, {"b", "", "", true, true}, {"c", "", "", false, true}};
  }
  std::vector<std::string> losses() const override { return {}; }
  void check_settings(const Settings&, Use) const override {}
  bool sniffs(std::string_view, std::span<const std::byte>) const override { return false; }
  std::unique_ptr<PatchSource> open(const ReadRequest&) const override { return nullptr; }
  void write(const PatchSource&, const WriteRequest&) const override {}
};

Error refused(const Settings& settings, const std::function<void(const SettingsReader&)>& use = {}) {
  return testing::error_of([&] {
    const SettingsReader reader(FakeConverter(), settings, SettingsReader::Use::kReading);
    if (use) use(reader);
  });
}

TEST(SettingsReader, RefusesUnknownKeysAndListsTheKnown) {
  const Error error = refused({{"d", "1"}});
  EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
  EXPECT_THAT(error.message(), HasSubstr("'d' for reading"));
  EXPECT_THAT(error.hint(), HasSubstr("a, b"));
  EXPECT_THAT(refused({{"c", "1"}}).message(), HasSubstr("'c' for reading")) << "c is for writing";
}

TEST(SettingsReader, NumbersAreStrict) {
  for (const char* bad : {"", " 1", "1 ", "1m", "nan", "inf", "1e999", "0x10", "1,5", "+1"}) {
    const Error error = refused({{"a", bad}}, [](const SettingsReader& r) { r.number("a"); });
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument) << bad;
    EXPECT_THAT(error.message(), HasSubstr("is not a finite number"));
  }
  const Settings good{{"a", "-1.5e-3"}};
  EXPECT_EQ(SettingsReader(FakeConverter(), good, SettingsReader::Use::kReading).number("a"), -1.5e-3);
}

TEST(SettingsReader, ChecksRangesPointsAndChoices) {
  EXPECT_THAT(refused({{"a", "3"}}, [](const SettingsReader& r) { r.number("a", 0, 1); }).message(),
              HasSubstr("does not lie in 0..1"));
  for (const char* bad : {"1", "1,", ",1", "1,2,3", "1;2", "nan,0"}) {
    EXPECT_THAT(refused({{"a", bad}}, [](const SettingsReader& r) { r.point("a"); }).message(),
                HasSubstr("is not X,Y in metres"));
  }
  const std::array<std::string_view, 2> names{"x", "y"};
  EXPECT_THAT(refused({{"a", "z"}}, [&](const SettingsReader& r) { r.choice("a", names); }).message(),
              HasSubstr("one of x, y"));
  EXPECT_THAT(refused({{"a", "2"}}, [](const SettingsReader& r) { r.flag("a"); }).message(),
              HasSubstr("one of"));
}

TEST(FormatNumber, ReadsBackEqual) {
  for (const double v : {0.1, 0.05, 1.0 / 3, 1e-300, 123456789.123456789, -0.08}) {
    EXPECT_EQ(parse_number(format_number(v)), v);
  }
  EXPECT_EQ(format_number(0.08), "0.08");
}

TEST(Printable, EscapesWhatATerminalMustNotSee) {
  EXPECT_EQ(printable("plain \xc3\xa9 \xe2\x82\xac \xf0\x9f\x98\x80"),
            "plain \xc3\xa9 \xe2\x82\xac \xf0\x9f\x98\x80");
  EXPECT_EQ(printable("\x1b[31m\x7f"), "\\x1b[31m\\x7f");
  EXPECT_EQ(printable("\xff\xc0\xaf\xe2\x82"), "\\xff\\xc0\\xaf\\xe2\\x82");
  EXPECT_EQ(printable("\xed\xa0\x80\xc2\x9b"), "\\xed\\xa0\\x80\\xc2\\x9b");
  EXPECT_EQ(printable(std::string(100, 'a')), std::string(80, 'a') + "...");
}

TEST(CheckSettings, RefusesValuesWithoutAFile) {
  for (const Converter* converter : all()) {
    for (const Settings& bad :
         {Settings{{"edge_m", "0"}}, {{"datum", "1"}}, {{"mode", "x"}}, {{"epsg", "1.5"}}}) {
      const Error error = testing::error_of([&] { converter->check_settings(bad, Use::kReading); });
      EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument) << bad.begin()->first;
      EXPECT_EQ(error.path(), "");
    }
    converter->check_settings({{"edge_m", "10"}}, Use::kReading);
    converter->check_settings({}, Use::kWriting);
  }
}

}  // namespace
}  // namespace apgm::converters

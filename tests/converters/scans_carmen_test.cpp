#include <cmath>
#include <numbers>

#include "scans_support.hpp"

namespace apgm::converters::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class CarmenLogTest : public ::testing::Test {
 protected:
  ReadScans read(const std::string& text) { return read_scans(write_text(directory_ / "run.log", text)); }
  Error refused(const std::string& text) {
    return error_of([&] { read(text); });
  }
  TempDir directory_;
};

std::string robot_laser(const std::string& readings, const std::string& remissions = "0",
                        const std::string& step = "0.017453") {
  return "ROBOTLASER1 0 -1.570796 3.141593 " + step + " 81.9 0.01 0 " + readings + " " + remissions +
         " 20.5 -1.5 0.25 20 -1 0.25 0 0 0 0 0 1232658700.457304 host 222.2\n";
}

TEST_F(CarmenLogTest, ReadsAFrontLaser) {
  const ReadScans scans = read(flaser(180, 12.5));
  ASSERT_EQ(scans.list.size(), 1u);
  const LaserScan& scan = scans.laser(0);
  EXPECT_EQ(scan.source, "front");
  EXPECT_EQ(scan.stamp_ns, 12'500'000'000);
  EXPECT_EQ(scan.pose, Pose::planar(1, 2, 0.5));
  EXPECT_EQ(scan.angle_min_rad, -std::numbers::pi / 2);
  EXPECT_EQ(scan.angle_step_rad, std::numbers::pi / 180);
  EXPECT_EQ(scan.ranges_m, std::vector<float>(180, 2.0f));
  EXPECT_TRUE(scans.faults.empty());
}

TEST_F(CarmenLogTest, OddNumbersOfBeamsReachBothEndsOfTheFieldOfView) {
  for (const int n : {181, 361}) {
    const ReadScans scans = read(flaser(n, 1));
    EXPECT_EQ(scans.laser(0).angle_step_rad, std::numbers::pi / (n - 1));
  }
  EXPECT_EQ(read(flaser(360, 1)).laser(0).angle_step_rad, std::numbers::pi / 360);
  EXPECT_TRUE(std::isfinite(read(flaser(1, 1)).laser(0).angle_step_rad));
}

TEST_F(CarmenLogTest, FarReadingsOfOldLogsMeanNoReturn) {
  const double limit = read(flaser(180, 1)).laser(0).max_range_m;
  EXPECT_LE(limit, 81.83);
  EXPECT_GT(limit, 80);
}

TEST_F(CarmenLogTest, ReadsARearLaser) {
  const ReadScans scans = read("R" + flaser(5, 1).substr(1));
  EXPECT_EQ(scans.laser(0).source, "rear");
  EXPECT_EQ(scans.laser(0).pose, Pose::planar(1, 2, 0.5));
}

TEST_F(CarmenLogTest, ReadsARobotLaserByThePoseOfTheLaser) {
  const ReadScans scans = read(robot_laser("3 1.5 2.5 81.91"));
  ASSERT_EQ(scans.list.size(), 1u);
  const LaserScan& scan = scans.laser(0);
  EXPECT_EQ(scan.source, "laser1");
  EXPECT_NEAR(static_cast<double>(scan.stamp_ns - 1232658700457304000), 0, 500);
  EXPECT_EQ(scan.pose, Pose::planar(20.5, -1.5, 0.25));
  EXPECT_EQ(scan.angle_min_rad, -1.570796);
  EXPECT_EQ(scan.angle_step_rad, 0.017453);
  EXPECT_EQ(scan.max_range_m, 81.9);
  EXPECT_THAT(scan.ranges_m, ElementsAre(1.5f, 2.5f, 81.91f));
}

TEST_F(CarmenLogTest, PassesOverRemissions) {
  const ReadScans scans = read(robot_laser("2 1.5 2.5", "2 100 200"));
  ASSERT_EQ(scans.list.size(), 1u);
  EXPECT_THAT(scans.laser(0).ranges_m, ElementsAre(1.5f, 2.5f));
  EXPECT_EQ(scans.laser(0).pose, Pose::planar(20.5, -1.5, 0.25));
}

TEST_F(CarmenLogTest, RoundedStepsAreTakenFromTheFieldOfView) {
  std::string readings = "181";
  for (int i = 0; i < 181; ++i) readings += " 1";
  EXPECT_EQ(read(robot_laser(readings)).laser(0).angle_step_rad, 3.141593 / 180);
  EXPECT_EQ(read(robot_laser("3 1 1 1", "0", "0")).laser(0).angle_step_rad, 3.141593 / 2);
}

TEST_F(CarmenLogTest, OtherLinesAreIgnoredAndUnknownOnesCounted) {
  const ReadScans scans = read("# comment\n\nPARAM robot_length 1\nODOM 1 2 3\nNEFF 10\nGPS 1 2\n\x01\xff\n" +
                               flaser(2, 1) + "flaser 1\n");
  EXPECT_EQ(scans.list.size(), 1u);
  EXPECT_EQ(scans.count("unknown_lines"), 3u);
  EXPECT_EQ(scans.faults.at("unknown_lines").first, directory_ / "run.log" + std::string(":6"));
  EXPECT_EQ(scans.faults.size(), 1u);
}

TEST_F(CarmenLogTest, EveryCutOfALineIsSeen) {
  const std::string whole = flaser(4, 10), cut_me = flaser(4, 11);
  const std::size_t end = cut_me.rfind(' ');
  for (std::size_t size = 1; size < end; ++size) {
    const ReadScans scans = read(whole + cut_me.substr(0, size));
    EXPECT_EQ(scans.list.size(), 1u) << cut_me.substr(0, size);
    EXPECT_EQ(scans.count("cut_lines") + scans.count("unknown_lines"), 1u) << cut_me.substr(0, size);
  }
}

TEST_F(CarmenLogTest, EveryCutOfARobotLaserIsSeen) {
  const std::string whole = robot_laser("3 1 2 3", "1 9");
  const std::string cut_me = robot_laser("3 1 2 3", "1 9");
  const std::size_t end = cut_me.rfind(' ');
  for (std::size_t size = 1; size < end; ++size) {
    const ReadScans scans = read(whole + cut_me.substr(0, size));
    EXPECT_EQ(scans.list.size(), 1u) << cut_me.substr(0, size);
    EXPECT_EQ(scans.faults.size(), 1u) << cut_me.substr(0, size);
  }
}

TEST_F(CarmenLogTest, WrongNumbersOfReadingsAreTold) {
  std::string less = flaser(4, 11), more = flaser(4, 12);
  less[7] = '5';
  more[7] = '3';
  const ReadScans scans = read(flaser(4, 10) + less + more + robot_laser("2 1 2 3") + robot_laser("4 1 2 3") +
                               robot_laser("2 1 2", "5 1"));
  EXPECT_EQ(scans.list.size(), 1u);
  EXPECT_EQ(scans.count("wrong_beam_counts"), 5u);
  EXPECT_EQ(scans.faults.at("wrong_beam_counts").text,
            "5 lines hold other numbers of readings than they say (first: " +
                (directory_ / "run.log" + std::string(":2)")));
}

TEST_F(CarmenLogTest, HugeAndImpossibleCountsTakeNoMemory) {
  std::string bad;
  for (const char* count :
       {"18446744073709551615", "99999999999999999999", "-1", "4000000000", "0", "x", "1.5"}) {
    bad += "FLASER " + std::string(count) + " 1 2 3 1 2 3 4 host 5\n";
    bad += robot_laser(std::string(count) + " 1 2");
    bad += robot_laser("2 1 2", count == std::string("0") ? "-2" : count);
  }
  const ReadScans scans = read(flaser(2, 1) + bad);
  EXPECT_EQ(scans.list.size(), 1u);
  EXPECT_EQ(scans.count("wrong_beam_counts"), 21u);
}

TEST_F(CarmenLogTest, ImpossiblePosesAreLeftOut) {
  std::string text = flaser(2, 1);
  for (const char* pose : {"nan 2 0.5", "1 inf 0.5", "1 2 nan", "1e9 2 0.5", "1 2 1e5"}) {
    text += "FLASER 2 1 1 " + std::string(pose) + " 0 0 0 2 host 2\n";
  }
  const ReadScans scans = read(text);
  EXPECT_EQ(scans.list.size(), 1u);
  EXPECT_EQ(scans.count("bad_poses"), 5u);
}

TEST_F(CarmenLogTest, TextInPlaceOfNumbersIsLeftOut) {
  const ReadScans scans = read(flaser(2, 1) + flaser(2, 2, 1, "1,5") + flaser(2, 3, 1, "0x10") +
                               "FLASER 1 1 1 2 three 0 0 0 4 host 4\nFLASER 1 1 1 2 3 0 0 0 nan host 4\n" +
                               robot_laser("1 1", "0", "1e9"));
  EXPECT_EQ(scans.list.size(), 1u);
  EXPECT_EQ(scans.count("bad_numbers"), 5u);
}

TEST_F(CarmenLogTest, ReadingsThatAreNoNumberStayInTheScan) {
  const ReadScans scans = read(flaser(2, 1, 1, "nan"));
  ASSERT_EQ(scans.list.size(), 1u);
  EXPECT_TRUE(std::isnan(scans.laser(0).ranges_m[0]));
}

TEST_F(CarmenLogTest, TimesThatGoBackAreLeftOutBySensor) {
  const ReadScans scans =
      read(flaser(2, 10) + flaser(2, 9) + "R" + flaser(2, 5).substr(1) + flaser(2, 10) + flaser(2, 11));
  EXPECT_EQ(scans.list.size(), 4u);
  EXPECT_EQ(scans.count("times_back"), 1u);
}

TEST_F(CarmenLogTest, OneTimeFarAheadDoesNotCostTheRest) {
  std::string text = flaser(2, 10) + flaser(2, 1e9);
  for (int i = 0; i < 100; ++i) text += flaser(2, 11 + i);
  const ReadScans scans = read(text);
  EXPECT_EQ(scans.count("times_ahead"), 1u);
  EXPECT_EQ(scans.faults.at("times_ahead").first, directory_ / "run.log" + std::string(":2"));
  EXPECT_EQ(scans.faults.size(), 1u);
  ASSERT_EQ(scans.list.size(), 101u);
  for (std::size_t i = 1; i < scans.list.size(); ++i) {
    ASSERT_LE(scans.laser(i).stamp_ns - scans.laser(i - 1).stamp_ns, 1'000'000'000);
  }
}

TEST_F(CarmenLogTest, AJumpAheadCountsOnceASecondScanFollows) {
  constexpr double kDay_s = 86'400;
  const ReadScans scans = read(flaser(2, 0) + flaser(2, kDay_s) + flaser(2, 3 * kDay_s) +
                               flaser(2, 3 * kDay_s + 0.1) + flaser(2, 3 * kDay_s + 0.2));
  EXPECT_EQ(scans.list.size(), 4u);
  EXPECT_EQ(scans.count("times_ahead"), 1u);
  std::string rare;
  for (int week = 0; week < 20; ++week) rare += flaser(2, 7 * kDay_s * week);
  EXPECT_EQ(read(rare).list.size(), 19u);
}

TEST_F(CarmenLogTest, ClocksThatAreSetBackCountAfterTwenty) {
  std::string text = flaser(2, 5000);
  for (int i = 0; i < 100; ++i) text += flaser(2, 11 + i);
  const ReadScans scans = read(text);
  EXPECT_EQ(scans.count("times_back"), 20u);
  EXPECT_EQ(scans.list.size(), 81u);
}

TEST_F(CarmenLogTest, TimesWhoseDifferenceCannotBeHeldAreNone) {
  const ReadScans scans = read(flaser(2, -4.6e9) + flaser(2, 4.6e9) + flaser(2, 4.6e9) + flaser(2, 4.7e9) +
                               flaser(2, -4.7e9) + flaser(2, 9e9) + flaser(2, 1e300));
  ASSERT_EQ(scans.list.size(), 2u);
  EXPECT_EQ(scans.laser(1).stamp_ns - scans.laser(0).stamp_ns, 9'200'000'000'000'000'000);
  EXPECT_EQ(scans.count("times_ahead"), 1u);
  EXPECT_EQ(scans.count("bad_numbers"), 4u);
}

TEST_F(CarmenLogTest, OneSignStandsBeforeANumber) {
  EXPECT_EQ(read(flaser(2, 1, 1, "+3")).laser(0).ranges_m[0], 3);
  for (const char* reading : {"+-3", "++3", "--3", "-+3", "+"}) {
    EXPECT_EQ(read(flaser(2, 1) + flaser(2, 2, 1, reading)).count("bad_numbers"), 1u) << reading;
  }
}

TEST_F(CarmenLogTest, ReadingsOutOfFloatStayInTheScan) {
  const std::string zeros(60, '0');
  const std::vector<std::pair<std::string, float>> cases{{"1e39", INFINITY},
                                                         {"1e400", INFINITY},
                                                         {"-1e39", -INFINITY},
                                                         {"+1E+4000", INFINITY},
                                                         {"1" + zeros, INFINITY},
                                                         {"1" + zeros + ".5", INFINITY},
                                                         {"1e-46", 0},
                                                         {"1E-4000", 0},
                                                         {"0." + zeros + "1", 0},
                                                         {"-0." + zeros + "1", 0}};
  for (const auto& [text, value] : cases) {
    const ReadScans scans = read(flaser(2, 1, 1, text));
    ASSERT_EQ(scans.list.size(), 1u) << text;
    EXPECT_EQ(scans.laser(0).ranges_m[0], value) << text;
    EXPECT_TRUE(scans.faults.empty()) << text;
  }
  EXPECT_EQ(read(flaser(2, 1) + flaser(2, 2, 1, "1e39x")).count("bad_numbers"), 1u);
}

TEST_F(CarmenLogTest, GiantLinesArePassedOver) {
  const std::string giant = "FLASER 9 " + std::string(std::size_t{3} << 20, '1') + "\n";
  const ReadScans scans = read(flaser(2, 1) + giant + flaser(2, 2) + "FLASER " + std::string(2 << 20, ' '));
  EXPECT_EQ(scans.list.size(), 2u);
  EXPECT_EQ(scans.count("long_lines"), 2u);
  EXPECT_THAT(scans.faults.at("long_lines").first, HasSubstr("run.log:2"));
}

TEST_F(CarmenLogTest, LongLinesWithinTheLimitAreRead) {
  const ReadScans scans = read(flaser(150'000, 1) + flaser(2, 2));
  ASSERT_EQ(scans.list.size(), 2u);
  EXPECT_EQ(scans.laser(0).ranges_m.size(), 150'000u);
}

TEST_F(CarmenLogTest, CarriageReturnsAndAMissingLastLineEndAreFine) {
  std::string text = flaser(2, 1);
  text.insert(text.size() - 1, "\r");
  const std::string last = flaser(2, 2);
  const ReadScans scans = read(text + last.substr(0, last.size() - 1));
  EXPECT_EQ(scans.list.size(), 2u);
  EXPECT_TRUE(scans.faults.empty());
}

TEST_F(CarmenLogTest, NothingUsableIsAnErrorThatNamesFileAndLine) {
  const Error error = refused("PARAM x 1\nFLASER 3 1 2\n");
  EXPECT_EQ(error.code(), ErrorCode::kDamaged);
  EXPECT_THAT(error.message(), HasSubstr("run.log' holds no scan with a pose that can be used: "));
  EXPECT_THAT(error.message(), HasSubstr("1 line was cut short (first: "));
  EXPECT_THAT(error.message(), HasSubstr("run.log:2)"));
  EXPECT_EQ(error.path(), directory_ / "run.log");
}

TEST_F(CarmenLogTest, GarbageIsForeign) {
  const std::string path = write_text(directory_ / "noise", std::string("\x00\x01\xff noise", 10));
  EXPECT_EQ(error_of([&] { open_scans({{path}, "", ""}); }).code(), ErrorCode::kForeign);
  const std::string empty = write_text(directory_ / "empty", "");
  EXPECT_THAT(error_of([&] { open_scans({{empty}, "", ""}); }).message(), HasSubstr("it is empty"));
  EXPECT_EQ(error_of([&] { open_scans({{directory_ / "gone"}, "", ""}); }).code(), ErrorCode::kUnreadable);
}

TEST_F(CarmenLogTest, RandomBytesNeverCrash) {
  std::uint64_t state = 42;
  const auto next = [&state] { return state = state * 6364136223846793005u + 1442695040888963407u; };
  const std::string good = flaser(20, 1) + robot_laser("3 1 2 3", "2 4 5");
  for (int round = 0; round < 300; ++round) {
    std::string text = good;
    for (int change = 0; change < 8; ++change)
      text[(next() >> 33) % text.size()] = static_cast<char>(next() >> 56);
    try {
      (void)read_scans({{write_text(directory_ / "run.log", text)}, "", "carmen"});
    } catch (const Error&) {
      continue;
    }
  }
}

TEST_F(CarmenLogTest, LogsFollowEachOther) {
  const std::string a = write_text(directory_ / "a.log", flaser(2, 10));
  const std::string b = write_text(directory_ / "b.log", flaser(3, 5));
  const std::string none = write_text(directory_ / "c.log", "PARAM a b\n");
  const ReadScans scans = read_scans({{a, b, none}, "", ""});
  ASSERT_EQ(scans.list.size(), 2u);
  EXPECT_EQ(scans.laser(1).ranges_m.size(), 3u);
  EXPECT_EQ(scans.faults.at("empty_files").first, none);
}

TEST_F(CarmenLogTest, PosesAreRefused) {
  const std::string log = write_text(directory_ / "a.log", flaser(2, 10));
  const Error error = error_of([&] { open_scans({{log}, directory_ / "poses.txt", ""}); });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
}

class PackedLogTest : public CarmenLogTest {};

TEST_F(PackedLogTest, GivesWhatThePlainLogGives) {
  std::string text;
  for (int i = 0; i < 3000; ++i) text += flaser(50, i, i % 10);
  const ReadScans plain = read(text);
  const std::string whole = packed(text);
  // Two streams one after the other are one file, as parallel packers write it.
  const std::string halves = packed(text.substr(0, 100'000)) + packed(text.substr(100'000));
  for (const std::string& bytes : {whole, halves}) {
    const ReadScans scans = read_scans(write_text(directory_ / "run.log.bz2", bytes));
    ASSERT_EQ(scans.list.size(), plain.list.size());
    for (std::size_t i = 0; i < plain.list.size(); ++i) {
      ASSERT_EQ(scans.laser(i).stamp_ns, plain.laser(i).stamp_ns);
      ASSERT_EQ(scans.laser(i).pose, plain.laser(i).pose);
      ASSERT_EQ(scans.laser(i).ranges_m, plain.laser(i).ranges_m);
    }
  }
}

TEST_F(PackedLogTest, DamageIsAnError) {
  std::string text;
  for (int i = 0; i < 3000; ++i) text += flaser(50, i);
  const std::string good = packed(text);
  for (const std::size_t at : {good.size() / 5, good.size() / 2, good.size() - 3}) {
    std::string bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 0x10);
    const Error error = error_of([&] { read_scans(write_text(directory_ / "run.log.bz2", bad)); });
    EXPECT_EQ(error.code(), ErrorCode::kDamaged) << at;
    EXPECT_THAT(error.message(), HasSubstr("its bzip2 data fails its check near byte")) << at;
    EXPECT_TRUE(error.offset_bytes().has_value());
  }
  for (const std::size_t size : {std::size_t{40}, good.size() / 2, good.size() - 1}) {
    const Error error = error_of([&] {
      read_scans({{write_text(directory_ / "cut.log.bz2", good.substr(0, size))}, "", "carmen"});
    });
    EXPECT_EQ(error.code(), ErrorCode::kDamaged) << size;
    EXPECT_THAT(error.message(), HasSubstr("its bzip2 data ends early")) << size;
  }
}

TEST_F(PackedLogTest, OtherBytesBehindTheDataArePassedOver) {
  const std::string good = packed(flaser(2, 1) + flaser(2, 2));
  for (const std::string& tail : {std::string("\n"), std::string("B"), std::string("BZ"), std::string("BZx9"),
                                  std::string(100'000, '\0'), std::string(70'000, 'x') + good}) {
    EXPECT_EQ(read_scans(write_text(directory_ / "run.log.bz2", good + tail)).list.size(), 2u) << tail.size();
  }
  const Error error = error_of([&] {
    read_scans({{write_text(directory_ / "run.log.bz2", good + "BZh9oops")}, "", "carmen"});
  });
  EXPECT_EQ(error.code(), ErrorCode::kDamaged);
}

TEST_F(PackedLogTest, StreamsDivideAnywhere) {
  // The second stream begins at each place round the end of what is read of a file at once.
  std::uint64_t state = 1;
  std::string noise = "# ";
  const auto next = [&state] { return state = state * 6364136223846793005u + 1442695040888963407u; };
  while (noise.size() < 86'500) noise += static_cast<char>('0' + (next() >> 40) % 64);
  const std::string tail = packed(flaser(2, 7));
  int met = 0;
  for (std::size_t size = noise.size(); size > 60'000 && met < 8; --size) {
    const std::string head = packed(flaser(2, 1) + noise.substr(0, size) + "\n");
    if (head.size() + 3 > 65'536 + 3) continue;
    if (head.size() < 65'536 - 4) break;
    ++met;
    EXPECT_EQ(read_scans(write_text(directory_ / "run.log.bz2", head + tail)).list.size(), 2u) << head.size();
  }
  EXPECT_GT(met, 0);
}

TEST_F(PackedLogTest, NameDoesNotCount) {
  EXPECT_EQ(read_scans(write_text(directory_ / "run", packed(flaser(2, 1)))).list.size(), 1u);
  EXPECT_EQ(read_scans(write_text(directory_ / "run.bz2", flaser(2, 1))).list.size(), 1u);
}

class RealLogTest : public ::testing::Test {};

TEST_F(RealLogTest, Intel) {
  const std::string path = real_data("scans/intel.gfs.log");
  if (path.empty()) GTEST_SKIP() << "no recording scans/intel.gfs.log";
  const ReadScans scans = read_scans(path);
  EXPECT_EQ(scans.list.size() + scans.count("times_back"), 910u);
  EXPECT_EQ(scans.count("times_back"), 4u);
  EXPECT_EQ(scans.faults.size(), 1u);
  for (std::size_t i = 0; i < scans.list.size(); ++i) ASSERT_EQ(scans.laser(i).ranges_m.size(), 180u);
}

TEST_F(RealLogTest, FreiburgClinic) {
  const std::string path = real_data("scans/fr-clinic_robotlaser.clf.bz2");
  if (path.empty()) GTEST_SKIP() << "no recording scans/fr-clinic_robotlaser.clf.bz2";
  const ReadScans scans = read_scans(path);
  EXPECT_EQ(scans.list.size(), 6917u);
  EXPECT_TRUE(scans.faults.empty());
  double travelled = 0;
  for (std::size_t i = 1; i < scans.list.size(); ++i) {
    const Point a = scans.laser(i - 1).pose.position(), b = scans.laser(i).pose.position();
    travelled += std::hypot(b.x_m - a.x_m, b.y_m - a.y_m);
  }
  EXPECT_NEAR(travelled, 1405, 15);
}

}  // namespace
}  // namespace apgm::converters::testing

#include <cmath>

#include "converters/scans/lzf.hpp"
#include "scans_support.hpp"

namespace apgm::converters::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::vector<float> kXyz{1, 2, 3, 4, 5, 6};

class CloudTest : public ::testing::Test {
 protected:
  std::string put(const std::string& name, const std::string& bytes) const {
    return write_text(directory_ / name, bytes);
  }
  ReadScans read(const std::string& name, const std::string& bytes) const {
    return read_scans(put(name, bytes));
  }
  Error refused(const std::string& name, const std::string& bytes) const {
    return error_of([&] { read(name, bytes); });
  }
  TempDir directory_;
};

std::string pcd_header(const std::string& data, const std::string& points = "2",
                       const std::string& fields = "x y z", const std::string& sizes = "4 4 4",
                       const std::string& types = "F F F", const std::string& counts = "1 1 1",
                       const std::string& viewpoint = "0 0 0 1 0 0 0") {
  return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS " + fields + "\nSIZE " + sizes +
         "\nTYPE " + types + "\nCOUNT " + counts + "\nWIDTH " + points + "\nHEIGHT 1\nVIEWPOINT " +
         viewpoint + "\nPOINTS " + points + "\nDATA " + data + "\n";
}

std::string point_bytes() { return raw(1.f, 2.f, 3.f, 4.f, 5.f, 6.f); }

class PcdTest : public CloudTest {};

TEST_F(PcdTest, Ascii) {
  EXPECT_EQ(read("a.pcd", pcd_header("ascii") + "1 2 3\n4 5 6\n").cloud(0).xyz_m, kXyz);
}

TEST_F(PcdTest, Binary) {
  const ReadScans scans = read("a.pcd", pcd_header("binary") + point_bytes());
  EXPECT_EQ(scans.cloud(0).xyz_m, kXyz);
  EXPECT_EQ(scans.cloud(0).pose, Pose{});
  EXPECT_TRUE(scans.faults.empty());
}

TEST_F(PcdTest, OtherFieldsArePassedOver) {
  const std::string header =
      pcd_header("binary", "1", "rgb z normal x y", "4 8 4 4 8", "U F F F F", "1 1 3 1 1");
  const std::string point = raw(std::uint32_t{7}, 3.0, 0.f, 0.f, 0.f, 1.f, 2.0);
  EXPECT_THAT(read("a.pcd", header + point).cloud(0).xyz_m, ElementsAre(1, 2, 3));
  const std::string ascii =
      pcd_header("ascii", "1", "rgb z normal x y", "4 8 4 4 8", "U F F F F", "1 1 3 1 1");
  EXPECT_THAT(read("a.pcd", ascii + "7 3 0 0 0 1 2\n").cloud(0).xyz_m, ElementsAre(1, 2, 3));
}

TEST_F(PcdTest, ViewpointIsThePoseOfTheSensor) {
  const std::string header = pcd_header("binary", "2", "x y z", "4 4 4", "F F F", "1 1 1",
                                        "10 20 30 0.7071067811865476 0 0 0.7071067811865476");
  const Pose pose = read("a.pcd", header + point_bytes()).cloud(0).pose;
  EXPECT_EQ(pose.translation_m, (std::array<double, 3>{10, 20, 30}));
  EXPECT_NEAR(pose.apply({1, 0, 0})[1], 21, 1e-12);
}

TEST_F(PcdTest, AViewpointThatIsNoPoseMattersOnlyWithoutPoses) {
  const std::string cloud =
      pcd_header("binary", "2", "x y z", "4 4 4", "F F F", "1 1 1", "0 0 0 0 0 0 0") + point_bytes();
  const std::string path = put("a.pcd", cloud);
  const ReadScans placed = read_scans(path, put("poses.txt", "1 0 0 7 0 1 0 0 0 0 1 0\n"));
  ASSERT_EQ(placed.list.size(), 1u);
  EXPECT_EQ(placed.cloud(0).pose.translation_m[0], 7);
  EXPECT_EQ(placed.cloud(0).xyz_m, kXyz);
  EXPECT_TRUE(placed.faults.empty());
  EXPECT_THAT(error_of([&] { read_scans(path); }).message(), HasSubstr("1 scan has an impossible pose"));
}

TEST_F(PcdTest, CompressedLiterals) {
  const std::string columns = raw(1.f, 4.f, 2.f, 5.f, 3.f, 6.f);
  const std::string packed_columns = std::string(1, static_cast<char>(columns.size() - 1)) + columns;
  const std::string data =
      raw(static_cast<std::uint32_t>(packed_columns.size()), static_cast<std::uint32_t>(columns.size())) +
      packed_columns;
  EXPECT_EQ(read("a.pcd", pcd_header("binary_compressed") + data).cloud(0).xyz_m, kXyz);
}

TEST_F(PcdTest, CompressedDataThatLiesIsRefused) {
  const auto data = [](std::uint32_t packed_size, std::uint32_t size, const std::string& bytes) {
    return pcd_header("binary_compressed") + raw(packed_size, size) + bytes;
  };
  EXPECT_THAT(refused("a.pcd", data(4, 25, "abcd")).message(), HasSubstr("another size than its points"));
  EXPECT_THAT(refused("a.pcd", data(400, 24, "abcd")).message(), HasSubstr("ends within its data"));
  EXPECT_THAT(refused("a.pcd", data(4, 24,
                                    "\x1f"
                                    "bcd"))
                  .message(),
              HasSubstr("cannot be unpacked"));
  EXPECT_THAT(refused("a.pcd", data(2, 24, "\xe0\xff")).message(), HasSubstr("cannot be unpacked"));
  EXPECT_THAT(refused("a.pcd", pcd_header("binary_compressed") + "abc").message(),
              HasSubstr("ends before its data"));
  const std::string many =
      pcd_header("binary_compressed", "60000000") + raw(std::uint32_t{4}, std::uint32_t{720000000});
  EXPECT_THAT(refused("a.pcd", many + "abcd").message(), HasSubstr("cannot be unpacked"));
}

TEST_F(PcdTest, HugeCountsTakeNoMemory) {
  EXPECT_THAT(refused("a.pcd", pcd_header("binary", "18446744073709551615")).message(), HasSubstr("WIDTH"));
  EXPECT_THAT(refused("a.pcd", pcd_header("binary", "99999999999999999999999")).message(),
              HasSubstr("WIDTH"));
  const ReadScans scans = read("a.pcd", pcd_header("binary", "60000000") + point_bytes());
  EXPECT_EQ(scans.cloud(0).xyz_m, kXyz);
  EXPECT_EQ(scans.count("cut_clouds"), 1u);
}

TEST_F(PcdTest, BadHeadersNameTheLine) {
  const auto message = [&](const std::string& bytes) { return refused("a.pcd", bytes).message(); };
  EXPECT_THAT(message(pcd_header("zip")),
              HasSubstr("DATA is none of ascii, binary, binary_compressed in line 11"));
  EXPECT_THAT(message(pcd_header("ascii", "2", "x y")),
              HasSubstr("SIZE does not have a value for each of the FIELDS"));
  EXPECT_THAT(message(pcd_header("ascii", "2", "a y z")), HasSubstr("no field 'x'"));
  EXPECT_THAT(message(pcd_header("ascii", "2", "x y z", "2 4 4")), HasSubstr("field 'x' is no float"));
  EXPECT_THAT(message(pcd_header("ascii", "2", "x y z", "4 4 4", "I F F")),
              HasSubstr("field 'x' is no float"));
  EXPECT_THAT(message(pcd_header("ascii", "2", "x y z", "4 4 4", "F F F", "1 1 2")), HasSubstr("field 'z'"));
  EXPECT_THAT(message(pcd_header("ascii", "x")), HasSubstr("no whole number in line 7"));
  EXPECT_THAT(message("# .PCD v0.7\nFIELDS x y z\n"), HasSubstr("header has no end"));
  EXPECT_THAT(message("# .PCD v0.7\nFROGS 3\n"), HasSubstr("unknown key 'FROGS' in line 2"));
  EXPECT_THAT(message(pcd_header("ascii", "1", "x y z", "4 4 4", "F F F", "1 1 1", "0 0 0")),
              HasSubstr("VIEWPOINT does not have 7 numbers"));
  EXPECT_THAT(message(pcd_header("ascii", "0")), HasSubstr("it holds no point"));
}

TEST_F(PcdTest, BadLinesAreCounted) {
  const ReadScans scans = read("a.pcd", pcd_header("ascii", "5") + "1 2 3\n1 2\nx y z\n4 5 6\n");
  EXPECT_EQ(scans.cloud(0).xyz_m, kXyz);
  EXPECT_EQ(scans.count("cut_lines"), 1u);
  EXPECT_EQ(scans.count("bad_numbers"), 1u);
  EXPECT_EQ(scans.count("cut_clouds"), 1u);
  EXPECT_THAT(scans.faults.at("cut_lines").first, HasSubstr("a.pcd:13"));
}

TEST(UnpackLzfTest, CopiesThatOverlapRepeat) {
  const std::vector<unsigned char> in{0, 'a', 0xe0, 3, 0};  // 'a', then 12 bytes from 1 back
  std::vector<unsigned char> out(13);
  EXPECT_TRUE(unpack_lzf(in, out));
  EXPECT_EQ(out, std::vector<unsigned char>(13, 'a'));
  out.resize(12);
  EXPECT_FALSE(unpack_lzf(in, out));
  out.resize(14);
  EXPECT_FALSE(unpack_lzf(in, out));
}

TEST(UnpackLzfTest, RandomBytesStayWithinBounds) {
  std::uint64_t state = 7;
  const auto next = [&state] { return state = state * 6364136223846793005u + 1442695040888963407u; };
  for (int round = 0; round < 2000; ++round) {
    std::vector<unsigned char> in(next() >> 58), out((next() >> 33) % 200);
    for (auto& byte : in) byte = static_cast<unsigned char>(next() >> 56);
    (void)unpack_lzf(in, out);
  }
}

class KittiCloudTest : public CloudTest {};

TEST_F(KittiCloudTest, ReadsPointsWithoutIntensity) {
  EXPECT_EQ(read("a.bin", raw(1.f, 2.f, 3.f, 9.f, 4.f, 5.f, 6.f, 9.f)).cloud(0).xyz_m, kXyz);
}

TEST_F(KittiCloudTest, APointThatIsCutIsLeftOutAndTold) {
  const ReadScans scans = read("a.bin", raw(1.f, 2.f, 3.f, 9.f, 4.f, 5.f, 6.f, 9.f, 1.f));
  EXPECT_EQ(scans.cloud(0).xyz_m, kXyz);
  EXPECT_EQ(scans.count("cut_clouds"), 1u);
}

TEST_F(KittiCloudTest, ManyPoints) {
  std::string bytes;
  for (int i = 0; i < 10'000; ++i) bytes += raw(static_cast<float>(i), 0.f, 0.f, 0.f);
  const ReadScans scans = read("a.bin", bytes);
  ASSERT_EQ(scans.cloud(0).xyz_m.size(), 30'000u);
  for (std::size_t i = 0; i < 10'000; ++i) ASSERT_EQ(scans.cloud(0).xyz_m[3 * i], static_cast<float>(i));
  EXPECT_EQ(read("b.bin.bz2", packed(bytes)).cloud(0).xyz_m, scans.cloud(0).xyz_m);
}

class CsvCloudTest : public CloudTest {};

TEST_F(CsvCloudTest, ColumnsAreFoundByTheHeading) {
  EXPECT_EQ(read("a.csv", "nx, z ,y,x\n0,3,2,1\n0, 6 , 5 , 4\n").cloud(0).xyz_m, kXyz);
}

TEST_F(CsvCloudTest, WithoutAHeadingTheFirstThreeColumnsAreThePoint) {
  EXPECT_EQ(read("a.csv", "  1 2e0 3 9\n# comment\n  4 5 6 9\n").cloud(0).xyz_m, kXyz);
  EXPECT_EQ(read("a.xyz", "1,2,3\n4,5,6\n").cloud(0).xyz_m, kXyz);
  EXPECT_THAT(refused("a.csv", "a,b,c\n1,2,3\n").message(), HasSubstr("neither a heading with x, y and z"));
}

TEST_F(CsvCloudTest, BadLinesAreCounted) {
  const ReadScans scans = read("a.csv", "x,y,z\n1,2,3\n1,2\na,b,c\n\n4,5,6\n");
  EXPECT_EQ(scans.cloud(0).xyz_m, kXyz);
  EXPECT_EQ(scans.count("cut_lines"), 1u);
  EXPECT_EQ(scans.count("bad_numbers"), 1u);
}

class ScanGraphTest : public CloudTest {
 protected:
  static std::string vector(double x, double y, double z) { return raw(std::uint32_t{3}, x, y, z); }
  static std::string node(double x = 10) {
    return raw(std::uint32_t{2}) + vector(1, 2, 3) + vector(4, 5, 6) + vector(x, 20, 30) +
           raw(std::uint32_t{4}, 1.0, 0.0, 0.0, 0.0) + raw(std::uint32_t{0});
  }
  static std::string graph(const std::string& nodes, std::uint32_t count = 1) {
    return raw(count) + nodes + raw(std::uint32_t{0});
  }
};

TEST_F(ScanGraphTest, ReadsCloudsWithPoses) {
  const ReadScans scans = read("a.graph", graph(node() + node(11), 2));
  ASSERT_EQ(scans.list.size(), 2u);
  EXPECT_EQ(scans.cloud(0).xyz_m, kXyz);
  EXPECT_EQ(scans.cloud(0).pose.translation_m, (std::array<double, 3>{10, 20, 30}));
  EXPECT_EQ(scans.cloud(1).pose.translation_m[0], 11);
  EXPECT_GT(scans.cloud(1).stamp_ns, scans.cloud(0).stamp_ns);
}

TEST_F(ScanGraphTest, EveryTruncationIsAnErrorThatNamesTheByte) {
  const std::string whole = graph(node());
  for (std::size_t size = 1; size < whole.size() - 4; ++size) {
    const Error error = refused("a.graph", whole.substr(0, size));
    EXPECT_EQ(error.code(), ErrorCode::kDamaged) << size;
    EXPECT_THAT(error.message(), HasSubstr("at byte ")) << size;
  }
}

TEST_F(ScanGraphTest, HugeCountsTakeNoMemory) {
  std::string bytes = graph(node());
  const std::string many = raw(std::uint32_t{60'000'000});
  bytes.replace(4, 4, many);
  EXPECT_EQ(refused("a.graph", bytes).code(), ErrorCode::kDamaged);
  bytes.replace(4, 4, raw(std::uint32_t{0xffffffff}));
  EXPECT_EQ(refused("a.graph", bytes).code(), ErrorCode::kLimit);
}

TEST_F(ScanGraphTest, ImpossiblePosesAreLeftOut) {
  const ReadScans scans = read("a.graph", graph(node() + node(std::nan("")), 2));
  EXPECT_EQ(scans.list.size(), 1u);
  EXPECT_EQ(scans.count("bad_poses"), 1u);
}

class PosesTest : public CloudTest {
 protected:
  static std::string point(float x) { return raw(x, 0.f, 0.f, 0.f); }
  static std::string kitti(double x) { return "1 0 0 " + std::to_string(x) + " 0 1 0 0 0 0 1 0\n"; }
  static std::string tum(double t, double x) {
    return std::to_string(t) + " " + std::to_string(x) + " 0 0 0 0 0 1\n";
  }
  static std::vector<double> xs(const ReadScans& scans) {
    std::vector<double> list;
    for (std::size_t i = 0; i < scans.list.size(); ++i) list.push_back(scans.cloud(i).pose.translation_m[0]);
    return list;
  }
  /// Clouds of the given names in a directory of their own.
  std::string clouds(const std::vector<std::string>& names) const {
    std::filesystem::create_directory(directory_ / "clouds");
    for (const std::string& name : names) put("clouds/" + name, point(1));
    return directory_ / "clouds";
  }
};

TEST_F(PosesTest, OneRowForEachCloudInTheOrderOfNumbers) {
  const std::string dir = clouds({"10.bin", "9.bin", "1.bin"});
  const ReadScans scans = read_scans(dir, put("poses.txt", kitti(1) + kitti(2) + kitti(3)));
  EXPECT_THAT(xs(scans), ElementsAre(1, 2, 3));
  EXPECT_EQ(scans.cloud(1).stamp_ns - scans.cloud(0).stamp_ns, 100'000'000);
}

TEST_F(PosesTest, NumbersOfKittiNameTheRow) {
  const std::string dir = clouds({"000002.bin", "000000.bin", "000007.bin"});
  const ReadScans scans = read_scans(dir, put("poses.txt", kitti(5) + kitti(6) + kitti(7) + kitti(8)));
  EXPECT_THAT(xs(scans), ElementsAre(5, 7));
  EXPECT_EQ(scans.count("no_poses"), 1u);
  EXPECT_THAT(scans.faults.at("no_poses").first, HasSubstr("000007.bin"));
}

TEST_F(PosesTest, TimesOfTumNameTheRow) {
  const std::string dir = clouds({"100.01.bin", "101.2.bin", "102.bin"});
  const std::string poses =
      put("poses.txt", "# t x y z q\n" + tum(100, 1) + tum(101, 2) + tum(102, 3) + tum(103, 4));
  const ReadScans scans = read_scans(dir, poses);
  EXPECT_THAT(xs(scans), ElementsAre(1, 3));
  EXPECT_EQ(scans.cloud(1).stamp_ns, 102'000'000'000);
  EXPECT_EQ(scans.count("no_poses"), 1u);
}

TEST_F(PosesTest, PackedCloudsKeepTheirNames) {
  std::filesystem::create_directory(directory_ / "clouds");
  for (const char* name : {"000002.bin.bz2", "000000.bin.bz2"}) {
    put(std::string("clouds/") + name, packed(point(1)));
  }
  const std::string dir = directory_ / "clouds";
  EXPECT_THAT(xs(read_scans(dir, put("kitti.txt", kitti(5) + kitti(6) + kitti(7)))), ElementsAre(5, 7));
  EXPECT_THAT(xs(read_scans(dir, put("tum.txt", tum(0, 1) + tum(1, 2) + tum(2, 3)))), ElementsAre(1, 3));
}

TEST_F(PosesTest, OneTimeFarAheadCostsItsCloud) {
  const std::string dir = clouds({"a.bin", "b.bin", "c.bin"});
  const ReadScans scans = read_scans(dir, put("poses.txt", tum(1, 1) + tum(4e9, 2) + tum(2, 3)));
  EXPECT_THAT(xs(scans), ElementsAre(1, 3));
  EXPECT_THAT(scans.faults.at("times_ahead").first, HasSubstr("b.bin"));
}

TEST_F(PosesTest, TimesAtBothEndsAreCompared) {
  const std::string dir = clouds({"-4600000000.bin", "0.bin"});
  const ReadScans scans = read_scans(dir, put("poses.txt", tum(-1, 1) + tum(0, 2) + tum(4.6e9, 3)));
  EXPECT_THAT(xs(scans), ElementsAre(2));
}

TEST_F(PosesTest, BadRowsCostTheirCloudOnly) {
  const std::string dir = clouds({"0.bin", "1.bin", "2.bin", "3.bin", "4.bin"});
  const std::string poses =
      kitti(1) + "1 0 0\n" + "2 0 0 5 0 1 0 0 0 0 1 0\n" + "nan 0 0 5 0 1 0 0 0 0 1 0\n" + kitti(5);
  const ReadScans scans = read_scans(dir, put("poses.txt", poses));
  EXPECT_THAT(xs(scans), ElementsAre(1, 5));
  EXPECT_EQ(scans.count("cut_lines"), 1u);
  EXPECT_EQ(scans.count("bad_poses"), 2u);
}

TEST_F(PosesTest, TimesThatGoBackAreLeftOut) {
  const std::string dir = clouds({"a.bin", "b.bin", "c.bin"});
  const ReadScans scans = read_scans(dir, put("poses.txt", tum(2, 1) + tum(1, 2) + tum(3, 3)));
  EXPECT_THAT(xs(scans), ElementsAre(1, 3));
  EXPECT_EQ(scans.count("times_back"), 1u);
}

TEST_F(PosesTest, NumbersOfPosesAndCloudsThatDoNotFit) {
  const std::string dir = clouds({"a.bin", "b.bin"});
  const Error error = error_of([&] { read_scans(dir, put("poses.txt", kitti(1) + kitti(2) + kitti(3))); });
  EXPECT_EQ(error.code(), ErrorCode::kIncompatible);
  EXPECT_THAT(error.message(), HasSubstr("3 poses for 2 clouds"));
}

TEST_F(PosesTest, CloudsWithoutPosesAreRefused) {
  const std::string dir = clouds({"a.bin", "b.bin"});
  EXPECT_THAT(error_of([&] { read_scans(dir); }).message(), HasSubstr("2 clouds have no poses"));
  EXPECT_EQ(read_scans(dir + "/a.bin").list.size(), 1u);
}

TEST_F(PosesTest, FilesThatAreNoPoses) {
  const std::string dir = clouds({"a.bin"});
  EXPECT_THAT(error_of([&] { read_scans(dir, put("p", "1 2 3\n")); }).message(),
              HasSubstr("is no pose file: line 1"));
  EXPECT_THAT(error_of([&] { read_scans(dir, put("p", "")); }).message(), HasSubstr("is no pose file"));
  const Error none = error_of([&] { read_scans(dir, put("p", "nan 0 0 5 0 1 0 0 0 0 1 0\n")); });
  EXPECT_EQ(none.code(), ErrorCode::kDamaged);
  EXPECT_THAT(none.message(), HasSubstr("holds no usable pose: 1 scan has an impossible pose"));
  EXPECT_EQ(error_of([&] { read_scans(dir, directory_ / "gone"); }).code(), ErrorCode::kUnreadable);
}

TEST_F(PosesTest, ListsNameTheirClouds) {
  const std::string heading =
      "reading, gT00, gT01, gT02, gT03, gT10, gT11, gT12, gT13, gT20, gT21, gT22, gT23, gT30, gT31, gT32, "
      "gT33\n";
  const auto row = [](const std::string& name, int x) {
    return name + ", 1, 0, 0, " + std::to_string(x) + ",  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1\n";
  };
  put("a.csv", "x,y,z\n1,2,3\n");
  put("b.csv", "x,y,z\n1,2,3\n");
  const std::string list = put("list.csv", heading + row("b.csv", 7) + row("a.csv", 8));
  EXPECT_THAT(xs(read_scans(list)), ElementsAre(7, 8));
  EXPECT_THAT(xs(read_scans({{directory_ / "a.csv", directory_ / "b.csv"}, list, ""})), ElementsAre(8, 7));
  // Under other names the order counts; the list itself is none of the clouds of its directory.
  std::filesystem::rename(directory_ / "a.csv", directory_ / "y.csv");
  std::filesystem::rename(directory_ / "b.csv", directory_ / "x.csv");
  EXPECT_THAT(xs(read_scans({{directory_.path()}, list, ""})), ElementsAre(7, 8));
  EXPECT_EQ(error_of([&] { read_scans(list); }).code(), ErrorCode::kUnreadable);
}

TEST_F(PosesTest, ABadCloudCostsItselfOnly) {
  const std::string dir = clouds({"a.bin", "b.bin"});
  put("clouds/b.pcd", "# .PCD v0.7\nFIELDS x\nDATA ascii\n");
  put("clouds/c.bin", "");
  const ReadScans scans = read_scans(dir, put("p", kitti(1) + kitti(2) + kitti(3) + kitti(4)));
  EXPECT_THAT(xs(scans), ElementsAre(1, 2));
  EXPECT_EQ(scans.count("bad_clouds"), 2u);
  EXPECT_THAT(scans.faults.at("bad_clouds").first, HasSubstr("b.pcd' is damaged"));
}

TEST_F(PosesTest, DirectoriesWithoutClouds) {
  std::filesystem::create_directory(directory_ / "empty");
  const Error error = error_of([&] { read_scans(directory_ / "empty"); });
  EXPECT_EQ(error.code(), ErrorCode::kForeign);
  EXPECT_THAT(error.hint(), HasSubstr(".pcd"));
}

class RealCloudTest : public ::testing::Test {};

TEST_F(RealCloudTest, PointsOfTheScanGraph) {
  const std::string path = real_data("octomap/spherical_scan.graph");
  if (path.empty()) GTEST_SKIP() << "no recording octomap/spherical_scan.graph";
  const ReadScans scans = read_scans(path);
  ASSERT_EQ(scans.list.size(), 1u);
  EXPECT_EQ(scans.cloud(0).xyz_m.size(), 3 * 10'201u);
}

TEST_F(RealCloudTest, PointsOfThePcd) {
  const std::string path = real_data("scans/ndt_omp_251370668.pcd");
  if (path.empty()) GTEST_SKIP() << "no recording scans/ndt_omp_251370668.pcd";
  const ReadScans scans = read_scans(path);
  ASSERT_EQ(scans.list.size(), 1u);
  EXPECT_EQ(scans.cloud(0).xyz_m.size(), 3 * 69'088u);
  for (const float v : scans.cloud(0).xyz_m) ASSERT_LT(std::fabs(v), 300);
}

TEST_F(RealCloudTest, CloudsOfTheList) {
  const std::string list = real_data("scans/lpm_carCloudList.csv");
  const std::string a = real_data("scans/lpm_car_cloud400.csv"), b = real_data("scans/lpm_car_cloud401.csv");
  if (list.empty() || a.empty() || b.empty()) GTEST_SKIP() << "no recording scans/lpm_car_cloud40*.csv";
  const ReadScans scans = read_scans({{a, b}, list, ""});
  ASSERT_EQ(scans.list.size(), 2u);
  EXPECT_TRUE(scans.faults.empty());
  EXPECT_GT(scans.cloud(0).xyz_m.size(), 3 * 20'000u);
  EXPECT_NEAR(scans.cloud(1).pose.translation_m[1], 0.191433, 1e-9);
}

}  // namespace
}  // namespace apgm::converters::testing

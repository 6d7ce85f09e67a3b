// The laws of merge and crop from file to file, byte for byte.
#include <gtest/gtest.h>

#include "apgm/format/reader.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"
#include "apgm/ops/crop.hpp"
#include "apgm/ops/merge.hpp"
#include "random_map.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

class Files : public testing::Test {
 protected:
  std::string write(const std::string& name, const PatchSource& source) {
    Writer writer(dir_ / name, source.header());
    copy(source, source.header().types, writer, false);
    writer.finish();
    return dir_ / name;
  }

  /// Content id of the result, in `name`.
  std::string merge(const std::string& name, const std::vector<std::string>& paths, int threads = 1) {
    std::vector<std::unique_ptr<Reader>> readers;
    std::vector<MergeInput> inputs;
    for (const std::string& path : paths) {
      readers.push_back(std::make_unique<Reader>(path));
      inputs.push_back({readers.back().get(), path, 1.0f});
    }
    const MergePlan plan(inputs, {});
    Writer writer(dir_ / name, plan.header());
    RunOptions run;
    run.threads = threads;
    run.max_memory_bytes = 64u << 20;
    plan.run(writer, run);
    writer.finish();
    return writer.report().content_id;
  }

  std::string crop_file(const std::string& name, const std::string& path, const CropRegion& region,
                        int threads = 1) {
    const Reader reader(path);
    Writer writer(dir_ / name, crop_header(reader, region, {}));
    RunOptions run;
    run.threads = threads;
    crop(reader, region, {}, writer, run);
    writer.finish();
    return writer.report().content_id;
  }

  std::string bytes(const std::string& name) const { return test::read_file(dir_ / name); }

  test::TempDir dir_;
};

TEST_F(Files, MergeGivesTheSameBytesInAnyOrderAndOnAnyThreads) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    SCOPED_TRACE(seed);
    const std::string n = std::to_string(seed);
    const std::string a = write("a" + n, test::random_map(2 * seed));
    const std::string b = write("b" + n, test::random_map(2 * seed + 1));
    merge("ab1" + n, {a, b}, 1);
    merge("ab2" + n, {a, b}, 2);
    merge("ba" + n, {b, a}, 2);
    EXPECT_EQ(bytes("ab1" + n), bytes("ab2" + n));
    EXPECT_EQ(bytes("ab1" + n), bytes("ba" + n));
    EXPECT_GT(bytes("ab1" + n).size(), 1000u);
  }
}

TEST_F(Files, MergeWithAnEmptyMapKeepsTheContentId) {
  const Map map = test::random_map(1);
  const std::string a = write("a", map), empty = write("empty", Map(map.header()));
  const std::string id = Reader(a).content_id();
  EXPECT_EQ(merge("m", {a, empty}), id);
  EXPECT_EQ(merge("n", {empty, a}), id);
}

TEST_F(Files, CropOfAMergeIsTheMergeOfCrops) {
  test::RandomMapOptions options;
  options.min_step = options.max_step = 4;  // cells of 0.8 m
  const std::string a = write("a", test::random_map(1, options)),
                    b = write("b", test::random_map(2, options));
  const CropRegion region{Box{{-20.0, -9.6}, {16.8, 24.0}}, {}, nullptr};
  crop_file("ca", a, region);
  crop_file("cb", b, region);
  merge("m", {a, b});
  EXPECT_EQ(crop_file("cm", dir_ / "m", region), merge("mc", {dir_ / "ca", dir_ / "cb"}));
}

TEST_F(Files, CropGivesTheSameBytesOnAnyThreads) {
  const std::string a = write("a", test::random_map(1));
  const CropRegion region{{}, Polygon{{{{-30, -20}, {25, -31}, {19, 30}, {-5, 3}}}}, nullptr};
  crop_file("c1", a, region, 1);
  crop_file("c2", a, region, 2);
  EXPECT_EQ(bytes("c1"), bytes("c2"));
}

TEST_F(Files, CropOfEverythingKeepsTheContentId) {
  const std::string a = write("a", test::random_map(1));
  EXPECT_EQ(crop_file("c", a, {}), Reader(a).content_id());
}

TEST_F(Files, AFileComesBackAsTheMapItWas) {
  const Map map = test::random_map(6);
  const Reader reader(write("a", map));
  Map back(reader.header());
  MapSink sink(back);
  copy(reader, back.header().types, sink, false);
  EXPECT_EQ(test::difference(map, back, true), "");
}

}  // namespace
}  // namespace apgm

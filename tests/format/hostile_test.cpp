// Files with valid checksums that lie: what a stranger can make, not what a disk does.

#include <gmock/gmock.h>

#include <functional>

#include "apgm/core/error.hpp"
#include "block.hpp"
#include "index.hpp"
#include "map_header.hpp"
#include "sample_map.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

using test::sample_map;
using test::TempDir;

class HostileTest : public testing::Test {
 protected:
  void SetUp() override { start_from(sample_map(31, 4, 4)); }

  void start_from(const Map& map) {
    test::write_map(map, dir_ / "good.apgm", {.output = {.overwrite = true}});
    good_ = test::read_file(dir_ / "good.apgm");
    std::memcpy(&footer_, good_.data() + good_.size() - sizeof(footer_), sizeof(footer_));
    root_ =
        format::read_root(std::as_bytes(std::span(good_)).subspan(footer_.root_offset, footer_.root_bytes),
                          footer_.root_offset, 3);
  }

  /// The file with `root_` and `footer_` as they are now, all hashes made again.
  std::string rebuilt() const {
    std::vector<std::byte> out;
    const auto front = std::as_bytes(std::span(good_)).first(footer_.root_offset);
    out.assign(front.begin(), front.end());
    format::append_root(out, root_.pages, root_.totals);
    format::Footer footer = footer_;
    footer.root_bytes = out.size() - footer_.root_offset;
    footer.root_hash =
        format::read_as<format::BlockHeader>(format::Bytes(out).subspan(footer_.root_offset)).payload_hash;
    footer.file_bytes = out.size() + format::kFooterBlockBytes;
    format::append_block(out, format::Kind::kFooter, 0, {}, format::bytes_of(footer));
    return {reinterpret_cast<const char*>(out.data()), out.size()};
  }

  std::optional<ErrorCode> code_of(const std::string& bytes) {
    test::write_file(dir_ / "bad.apgm", bytes);
    try {
      test::read_map(dir_ / "bad.apgm");
      return {};
    } catch (const Error& e) {
      return e.code();
    }
  }

  TempDir dir_;
  std::string good_;
  format::Footer footer_;
  format::Root root_;
};

TEST_F(HostileTest, UnchangedFileIsRebuiltToTheByte) { EXPECT_EQ(rebuilt(), good_); }

TEST_F(HostileTest, TotalsThatHideTheStepsOfLayers) {
  for (Summary::OfType& t : root_.totals) {
    t.layers_at.fill(0);
    t.layers_at[kMaxStep] = t.layers;
  }
  EXPECT_EQ(code_of(rebuilt()), ErrorCode::kDamaged);
}

TEST_F(HostileTest, TotalsThatDoNotAddUp) {
  root_.totals[0].layers_at[0] += 1;
  EXPECT_EQ(code_of(rebuilt()), ErrorCode::kDamaged);
  root_.totals[0].layers += 1;
  EXPECT_EQ(code_of(rebuilt()), ErrorCode::kDamaged);
}

TEST_F(HostileTest, PageNamedTwice) {
  root_.pages.push_back(root_.pages[0]);
  EXPECT_EQ(code_of(rebuilt()), ErrorCode::kDamaged);
}

TEST_F(HostileTest, PageNamedManyTimesWithTotalsThatFit) {
  // One patch alone in its page: the keys of two references touch, only the order of entries tells.
  Map map(sample_map(1).header());
  map.layer({3, 4}, 0, 2).plane(0)[1] = 0.5f;
  start_from(map);
  for (int i = 0; i < 1000; ++i) root_.pages.push_back(root_.pages[0]);
  root_.totals[0].layers = root_.totals[0].layers_at[2] = footer_.layers = root_.pages.size();
  EXPECT_EQ(code_of(rebuilt()), ErrorCode::kDamaged);
}

TEST_F(HostileTest, FooterThatSaysAnotherExtent) {
  footer_.x_max += 1;
  EXPECT_EQ(code_of(rebuilt()), ErrorCode::kDamaged);
}

TEST_F(HostileTest, LayerWithAFalseContentHash) {
  const Reader reader(dir_ / "good.apgm");
  Writer writer(dir_ / "bad.apgm", reader.header());
  PatchInfo patch;
  reader.patches()->next(patch);
  std::vector<Parcel> parcels(1);
  parcels[0].patch = patch.patch;
  parcels[0].type = patch.layers[0].type;
  parcels[0].state = Parcel::State::kStored;
  reader.load_stored(patch.layers[0], parcels[0].stored);
  parcels[0].stored.content_hash ^= 1;
  writer.put(patch.patch, parcels);
  writer.finish();
  EXPECT_THROW(test::read_map(dir_ / "bad.apgm"), Error);
}

TEST(MapHeaderTest, WriterRefusesTextAReaderWouldNotGiveBack) {
  TempDir dir;
  const auto refuses = [&](const std::function<void(MapHeader&)>& change) {
    MapHeader header = sample_map(1).header();
    change(header);
    EXPECT_THROW(Writer(dir / "a.apgm", header), Error);
  };
  refuses([](MapHeader& h) { h.metadata[std::string("a\0b", 3)] = "x"; });
  refuses([](MapHeader& h) { h.metadata["a"] = "\xff"; });
  refuses([](MapHeader& h) { h.metadata[""] = "x"; });
  refuses([](MapHeader& h) { h.history[0].inputs = {"a b"}; });
  refuses([](MapHeader& h) { h.history[0].inputs = {""}; });
  refuses([](MapHeader& h) { h.frame.datum_x_um = std::numeric_limits<std::int64_t>::min(); });
}

}  // namespace
}  // namespace apgm

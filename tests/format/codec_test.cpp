#include "codec.hpp"

#include <gmock/gmock.h>
#include <zstd.h>

#include <random>

#include "apgm/core/error.hpp"
#include "content_id.hpp"
#include "sample_map.hpp"

namespace apgm::format {
namespace {

StoredLayer encoded(const Layer& layer, const LayerType& type, Lossy lossy = Lossy::kNone) {
  StoredLayer stored;
  encode(layer, type, 3, lossy, stored);
  return stored;
}

Layer decoded(const StoredLayer& stored, const LayerType& type) {
  Layer layer;
  decode(static_cast<Encoding>(stored.encoding), stored.step, stored.bytes, type, layer);
  return layer;
}

/// Cells by a function of (channel, index).
template <typename Value>
Layer filled(const LayerType& type, int step, Value value) {
  Layer layer(type, step);
  for (int c = 0; c < layer.channels(); ++c) {
    for (std::size_t i = 0; i < layer.cells(); ++i) layer.plane(c)[i] = value(c, i);
  }
  return layer;
}

TEST(CodecTest, ChoosesTheEncodingThatFits) {
  const LayerType type = LayerType::occupancy();
  std::mt19937_64 rng(1);
  const Layer constant = filled(type, 5, [](int c, std::size_t) { return c == 0 ? 0.25f : 0.5f; });
  const Layer stepped = filled(type, 5, [&](int, std::size_t) { return static_cast<float>(rng() % 4) / 8; });
  const Layer noise = filled(type, 6, [&](int, std::size_t) { return test::unit(rng) / 2; });
  EXPECT_EQ(encoded(constant, type).encoding, static_cast<int>(Encoding::kConstant));
  EXPECT_EQ(encoded(stepped, type).encoding, static_cast<int>(Encoding::kPalette));
  EXPECT_EQ(encoded(noise, type).encoding, static_cast<int>(Encoding::kMasked32));
  for (const Layer* layer : {&constant, &stepped, &noise}) {
    EXPECT_TRUE(same_cells(decoded(encoded(*layer, type), type), *layer));
  }
}

TEST(CodecTest, RoundTripsEveryStepAndManyPatterns) {
  std::mt19937_64 rng(2);
  for (const LayerType& type :
       {LayerType::occupancy(), LayerType::semantic("s", {"a", "b"}), LayerType::real("v", {"x"})}) {
    for (int step = 0; step <= 8; ++step) {
      for (int pattern = 0; pattern < 6; ++pattern) {
        Layer layer(type, step);
        for (std::size_t i = 0; i < layer.cells(); ++i) {
          if (pattern > 0 && rng() % 4 == 0) continue;
          const float v =
              pattern < 3 ? static_cast<float>(rng() % (pattern * 300 + 2)) / 2048 : test::unit(rng) / 2;
          layer.plane(0)[i] = v;
          if (type.stores_omega()) layer.plane(2)[i] = 1 - v;
        }
        canonicalise(layer, type);
        ASSERT_TRUE(same_cells(decoded(encoded(layer, type), type), layer))
            << type.name << step << ' ' << pattern;
      }
    }
  }
}

TEST(CodecTest, PaletteWorksOnBothSidesOf256) {
  const LayerType type = LayerType::occupancy();
  for (const int n : {255, 256, 257, 4095, 4096}) {
    const Layer layer = filled(type, 8, [&](int c, std::size_t i) {
      return c == 0 ? static_cast<float>(i * 7 % static_cast<std::size_t>(n)) / 8192 : 0.0f;
    });
    ASSERT_TRUE(same_cells(decoded(encoded(layer, type), type), layer)) << n;
  }
}

TEST(CodecTest, RefusesBodiesThatDoNotFit) {
  const LayerType type = LayerType::occupancy();
  std::mt19937_64 rng(3);
  const Layer noise = filled(type, 5, [&](int, std::size_t) { return test::unit(rng) / 2; });
  const StoredLayer good = encoded(noise, type);
  for (std::size_t size = 0; size < good.bytes.size(); size += 13) {
    StoredLayer cut = good;
    cut.bytes.resize(size);
    EXPECT_THROW(decoded(cut, type), Error) << size;
  }
  StoredLayer other = good;
  other.step = 6;
  EXPECT_THROW(decoded(other, type), Error);
  other = good;
  other.encoding = 9;
  EXPECT_THROW(decoded(other, type), Error);
  EXPECT_THROW(decoded(good, LayerType::semantic("s", {"a", "b"})), Error);
}

TEST(CodecTest, SurvivesRandomBodies) {
  std::mt19937_64 rng(4);
  const LayerType type = LayerType::occupancy();
  const StoredLayer good =
      encoded(filled(type, 4, [&](int, std::size_t) { return test::unit(rng) / 2; }), type);
  int refused = 0;
  for (int i = 0; i < 20'000; ++i) {
    StoredLayer bad = good;
    bad.encoding = static_cast<std::uint8_t>(rng() % 5);
    bad.step = static_cast<std::uint8_t>(rng() % 6);
    const auto flips = rng() % 4;
    for (std::uint64_t k = 0; k < flips; ++k)
      bad.bytes[rng() % std::min<std::size_t>(bad.bytes.size(), 64)] = std::byte(rng());
    try {
      EXPECT_TRUE(is_canonical(decoded(bad, type), type));
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kDamaged);
      ++refused;
    }
  }
  EXPECT_GT(refused, 15'000);
}

TEST(CodecTest, RefusesMassesOutOfRange) {
  const LayerType type = LayerType::occupancy();
  for (const float bad : {1.5f, -0.0f, -1.0f, std::numeric_limits<float>::quiet_NaN()}) {
    StoredLayer stored;
    stored.encoding = static_cast<std::uint8_t>(Encoding::kConstant);
    stored.step = 2;
    for (const float v : {bad, 0.0f}) {
      const Bytes b = bytes_of(v);
      stored.bytes.insert(stored.bytes.end(), b.begin(), b.end());
    }
    EXPECT_THROW(decoded(stored, type), Error) << bad;
  }
}

TEST(FrameTest, RefusesConcatenatedSkippableAndWronglySizedFrames) {
  std::vector<std::byte> content(100, std::byte{7}), out(100), frame;
  append_frame(frame, content, 3);
  EXPECT_NO_THROW(read_frame(frame, out));
  std::vector<std::byte> twice = frame;
  append_frame(twice, {}, 3);
  EXPECT_THROW(read_frame(twice, out), Error);
  const std::uint32_t skippable[] = {ZSTD_MAGIC_SKIPPABLE_START, 0};
  std::vector<std::byte> skip(std::as_bytes(std::span(skippable)).begin(),
                              std::as_bytes(std::span(skippable)).end());
  skip.insert(skip.end(), frame.begin(), frame.end());
  EXPECT_THROW(read_frame(skip, out), Error);
  std::vector<std::byte> larger(101);
  EXPECT_THROW(read_frame(frame, larger), Error);
}

TEST(ContentHashTest, TellsShapesApartThatHoldTheSameValues) {
  const Layer a(LayerType::occupancy(), 3);
  Layer b;
  b.reshape(8, 2);
  for (int c = 0; c < 8; ++c) std::ranges::fill(b.plane(c), 0.0f);
  EXPECT_NE(content_hash(a), content_hash(b));
}

}  // namespace
}  // namespace apgm::format

#include "codec_kernels.hpp"

#include <gmock/gmock.h>

#include <array>
#include <bit>
#include <cstring>
#include <random>
#include <vector>

namespace apgm::format {
namespace {

constexpr std::uint32_t kBackground = 0x7fc00000;
constexpr std::byte kUntouched{0xa5};

/// Every set of kernels this machine has, each of which must do as the plain one does.
class KernelsTest : public testing::TestWithParam<const Kernels*> {
 protected:
  const Kernels& k = *GetParam();
  std::mt19937_64 rng{20'261'122};

  /// Runs of background and of values, as in maps.
  std::vector<float> plane(std::size_t cells) {
    std::vector<float> out(cells);
    bool known = false;
    for (float& v : out) {
      if (rng() % 5 == 0) known = !known;
      v = std::bit_cast<float>(known ? static_cast<std::uint32_t>(rng()) : kBackground);
    }
    return out;
  }
  std::vector<std::uint32_t> values(std::size_t n) {
    std::vector<std::uint32_t> out(n);
    for (auto& v : out) v = static_cast<std::uint32_t>(rng());
    return out;
  }
  std::vector<std::byte> bytes(std::size_t n) {
    std::vector<std::byte> out(n);
    for (auto& b : out) b = static_cast<std::byte>(rng());
    return out;
  }
};

const std::vector<std::size_t> kSizes{1, 4, 7, 8, 9, 16, 31, 32, 33, 64, 100, 256, 1024, 1031, 16'384};

TEST_P(KernelsTest, PackAndScatterAreInversesAndTouchNoMoreThanTheirRoom) {
  for (const std::size_t cells : kSizes) {
    const std::vector<float> in = plane(cells);
    std::vector<std::byte> mask((cells + 7) / 8 + 1, kUntouched), plain_mask = mask;
    std::vector<std::uint32_t> packed(cells + Kernels::kSlack), plain(packed);
    const std::size_t n = k.pack(in.data(), cells, kBackground, mask.data(), packed.data());
    ASSERT_EQ(plain_kernels().pack(in.data(), cells, kBackground, plain_mask.data(), plain.data()), n);
    EXPECT_EQ(mask, plain_mask) << cells;
    EXPECT_EQ(mask.back(), kUntouched);
    EXPECT_TRUE(std::equal(packed.begin(), packed.begin() + static_cast<std::ptrdiff_t>(n), plain.begin()));
    EXPECT_EQ(k.count_bits(mask.data(), mask.size() - 1), n);
    packed.resize(n + Kernels::kSlack);
    packed.shrink_to_fit();
    std::vector<float> out(cells + 1, 0.5f);
    k.scatter(mask.data(), packed.data(), kBackground, out.data(), cells);
    EXPECT_EQ(std::memcmp(out.data(), in.data(), cells * sizeof(float)), 0) << cells;
    EXPECT_EQ(out.back(), 0.5f);
  }
}

TEST_P(KernelsTest, EveryMaskIsExpandedAndCompressed) {
  for (unsigned bits = 0; bits < 256; ++bits) {
    const auto mask = static_cast<std::byte>(bits);
    const auto from = values(8 + Kernels::kSlack);
    std::array<float, 8> out{};
    k.scatter(&mask, from.data(), kBackground, out.data(), 8);
    std::size_t next = 0;
    for (std::size_t i = 0; i < 8; ++i) {
      const std::uint32_t expected = (bits >> i & 1u) != 0 ? from[next++] : kBackground;
      ASSERT_EQ(std::bit_cast<std::uint32_t>(out[i]), expected) << bits << ' ' << i;
    }
  }
}

TEST_P(KernelsTest, SplitGivesBytePlanesAndJoinTakesThem) {
  for (const std::size_t n : kSizes) {
    const auto from = values(n);
    std::vector<std::byte> planes(4 * n + 1, kUntouched);
    k.split(from.data(), n, planes.data());
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t byte = 0; byte < 4; ++byte) {
        ASSERT_EQ(planes[(3 - byte) * n + i], static_cast<std::byte>(from[i] >> (8 * byte))) << n << ' ' << i;
      }
    }
    EXPECT_EQ(planes.back(), kUntouched);
    const std::byte* const at[4] = {&planes[3 * n], &planes[2 * n], &planes[n], &planes[0]};
    std::vector<std::uint32_t> joined(n);
    k.join(at, n, joined.data());
    EXPECT_EQ(joined, from) << n;
  }
}

TEST_P(KernelsTest, LooksUpTablesOfAnySize) {
  for (const std::size_t entries : {1, 2, 15, 16, 17, 255, 256}) {
    const auto table = values(entries);
    for (const std::size_t n : kSizes) {
      auto indices = bytes(n);
      for (auto& i : indices) i = static_cast<std::byte>(static_cast<std::size_t>(i) % entries);
      std::vector<float> out(n + 1, 0.5f);
      k.look_up(indices.data(), n, table.data(), entries, out.data());
      for (std::size_t i = 0; i < n; ++i) {
        ASSERT_EQ(std::bit_cast<std::uint32_t>(out[i]), table[static_cast<std::size_t>(indices[i])])
            << entries << ' ' << n << ' ' << i;
      }
      EXPECT_EQ(out.back(), 0.5f);
    }
  }
}

TEST_P(KernelsTest, OneBadMassAnywhereIsFound) {
  const float high = std::bit_cast<float>(0x3f800008u);
  for (const std::size_t cells : {std::size_t{1}, std::size_t{4}, std::size_t{16}, std::size_t{64}}) {
    std::vector<std::vector<float>> planes(3, std::vector<float>(cells, 0.25f));
    const auto all_good = [&](float low) {
      const float* const at[] = {planes[0].data(), planes[1].data(), planes[2].data()};
      return k.are_masses(at, 3, cells, low, high);
    };
    EXPECT_TRUE(all_good(0));
    EXPECT_FALSE(all_good(0.8f));
    for (auto& plane : planes) {
      for (float& v : plane) {
        // Too large, negative, -0, infinite, no number; 0.51 makes the sum too large, 0.5 does not.
        for (const float bad :
             {1.5f, -0.25f, -0.0f, std::bit_cast<float>(0x7f800000u), std::bit_cast<float>(kBackground),
              std::bit_cast<float>(0xffc00001u), 0.51f}) {
          v = bad;
          ASSERT_FALSE(all_good(0)) << cells << ' ' << bad;
        }
        v = 0.5f;
        ASSERT_TRUE(all_good(0)) << cells;
        v = 0.25f;
      }
    }
  }
}

std::vector<const Kernels*> all_kernels() {
  std::vector<const Kernels*> all{&plain_kernels()};
  if (avx2_kernels() != nullptr) all.push_back(avx2_kernels());
  return all;
}

INSTANTIATE_TEST_SUITE_P(Each, KernelsTest, testing::ValuesIn(all_kernels()),
                         [](const auto& test) { return test.param == &plain_kernels() ? "plain" : "avx2"; });

}  // namespace
}  // namespace apgm::format

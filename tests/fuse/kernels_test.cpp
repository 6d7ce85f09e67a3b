// The kernels' bodies once more, for the machine's base instruction set: the clones that are picked at
// start-up must give the same bytes.
#include <gtest/gtest.h>

#include <bit>
#include <cstring>

#include "apgm/fuse/combine.hpp"
#include "fuse/combine_loops.hpp"
#include "fuse/dempster_loops.hpp"
#include "fuse/resample_loops.hpp"
#include "layers.hpp"

namespace apgm {
namespace {

using test::Random;

bool same(std::span<const float> a, std::span<const float> b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}

TEST(Kernels, DempsterClonesGiveTheBytesOfTheBaseCode) {
  Random random(21);
  const Layer a = test::random_occupancy(7, random), b = test::random_occupancy(7, random);
  Layer x(LayerType::occupancy(), 7), y = x;
  std::vector<float> kx(a.cells()), ky(kx);
  const fuse::OccupancyPlanes pa{a.plane(0).data(), a.plane(1).data()},
      pb{b.plane(0).data(), b.plane(1).data()};
  // Odd counts reach the loops' tails.
  for (const std::size_t n : {a.cells(), a.cells() - 1, a.cells() - 7, std::size_t{3}}) {
    const auto total = fuse::dempster_two(pa, pb, {x.plane(0).data(), x.plane(1).data()}, kx.data(), n);
    const auto base =
        fuse::loop::dempster_two<true>({pa, pb, {y.plane(0).data(), y.plane(1).data()}, ky.data()}, n);
    EXPECT_EQ(total, base);
    EXPECT_TRUE(same_cells(x, y));
    EXPECT_TRUE(same(kx, ky));
  }
}

/// FNV-1a over the bits.
std::uint64_t digest(std::span<const float> values, std::uint64_t hash = 0xcbf29ce484222325u) {
  for (const float v : values) {
    for (int shift = 0; shift < 32; shift += 8) {
      hash = (hash ^ (std::bit_cast<std::uint32_t>(v) >> shift & 0xff)) * 0x100000001b3u;
    }
  }
  return hash;
}

/// Cells of all kinds, the same on every machine: made of whole numbers and powers of two.
Layer pinned_cells(std::uint64_t seed) {
  Random random(seed);
  const auto mass = [&] {
    const auto fraction = static_cast<float>(random() >> 40) * 0x1p-24f;
    const auto kind = random() % 8;
    if (kind == 0) return 0.0f;
    if (kind == 1) return 1.0f - 0x1p-24f * static_cast<float>(random() % 4);
    return kind < 5 ? fraction : std::ldexp(fraction, -static_cast<int>(random() % 150));
  };
  Layer layer(LayerType::occupancy(), 7);
  for (std::size_t i = 0; i < layer.cells(); ++i) {
    const float m = mass();
    const float other = std::min(mass(), 1.0f - m);
    const int first = static_cast<int>(random() % 2);
    layer.plane(first)[i] = m;
    layer.plane(1 - first)[i] = other;
  }
  return layer;
}

TEST(Kernels, DempsterKeepsItsBytes) {
  // Whoever makes the kernel faster must not change a bit of what it gives.
  const Layer a = pinned_cells(1), b = pinned_cells(2);
  Layer out;
  std::vector<float> k(a.cells());
  const auto total =
      combine(std::array<const Layer*, 2>{&a, &b}, LayerType::occupancy(), Rule::kDempster, out, k.data())
          .total_conflicts;
  EXPECT_EQ(digest(out.plane(1), digest(out.plane(0))), 838001140118258490u);
  EXPECT_EQ(digest(k), 17939672165621936494u);
  EXPECT_EQ(total, 14u);
  combine(std::array<const Layer*, 2>{&a, &b}, LayerType::occupancy(), Rule::kDempster, out);
  EXPECT_EQ(digest(out.plane(1), digest(out.plane(0))), 838001140118258490u);
}

TEST(Kernels, TwoLayersGiveTheBytesOfTheGeneralFold) {
  Random random(22);
  const Layer a = test::random_occupancy(7, random), b = test::random_occupancy(7, random);
  Layer two(LayerType::occupancy(), 7), three(LayerType::occupancy(), 7);
  const Layer none(LayerType::occupancy(), 7);
  const std::array<const Layer*, 3> in{&b, &none, &a};
  combine(std::array<const Layer*, 2>{&a, &b}, LayerType::occupancy(), Rule::kDempster, two);
  combine(in, LayerType::occupancy(), Rule::kDempster, three);
  EXPECT_TRUE(same_cells(two, three));
}

TEST(Kernels, FoldClonesGiveTheBytesOfTheBaseCode) {
  Random random(23);
  const LayerType type = LayerType::semantic("s", {"a", "b", "c", "d"});
  constexpr std::size_t kInputs = 5, kWidth = 5;
  std::vector<float> x(kInputs * kWidth * fuse::kBlock);
  for (std::size_t i = 0; i < kInputs; ++i) {
    const Layer layer = test::random_semantic(type, 4, random);
    for (std::size_t c = 0; c < kWidth; ++c) {
      std::ranges::copy(layer.plane(static_cast<int>(c)), &x[(i * kWidth + c) * fuse::kBlock]);
    }
  }
  std::vector<float> y = x;
  fuse::sort_inputs(x.data(), kInputs, kWidth);
  fuse::loop::sort_inputs(y.data(), kInputs, kWidth);
  EXPECT_TRUE(same(x, y));
  for (const bool normalise : {true, false}) {
    std::vector<std::int32_t> holds(fuse::kBlock), held(fuse::kBlock), held_base;
    fuse::holds_belief(x.data(), 4, held.data());
    held_base = held;
    std::vector<float> k(fuse::kBlock), k_base(fuse::kBlock);
    std::vector<float> p = x, q = x;
    for (std::size_t i = 1; i < kInputs; ++i) {
      const float* in = &x[i * kWidth * fuse::kBlock];
      fuse::holds_belief(in, 4, holds.data());
      fuse::fold(p.data(), in, 4, normalise, held.data(), holds.data(), k.data());
      fuse::loop::fold_conflict(q.data(), in, 4, held_base.data(), holds.data(), k_base.data(), normalise);
      fuse::loop::fold(q.data(), in, 4, normalise, held_base.data(), holds.data());
    }
    fuse::bound_masses(p.data(), 4, held.data());
    fuse::loop::bound_masses(q.data(), 4, held_base.data());
    EXPECT_TRUE(same(p, q));
    EXPECT_TRUE(same(k, k_base));
    EXPECT_EQ(held, held_base);
  }
}

TEST(Kernels, ResamplingClonesGiveTheBytesOfTheBaseCode) {
  Random random(24);
  const Layer in = test::random_occupancy(6, random);
  const float *o = in.plane(0).data(), *f = in.plane(1).data();
  for (const Policy policy : {Policy::kExclusive, Policy::kConditional, Policy::kMin, Policy::kProduct}) {
    const std::size_t n = in.cells() / 4;
    const fuse::RowPair rows{{o, o + 2 * n}, {f, f + 2 * n}};
    std::vector<float> p(2 * n), q(2 * n);
    fuse::merge_rows(policy, rows, p.data(), p.data() + n, n, 1);
    fuse::loop::merge_rows(policy, rows, q.data(), q.data() + n, n, 1);
    EXPECT_TRUE(same(p, q)) << to_string(policy);
    // As rows of 32, all at once.
    const fuse::RowPair pairs{{o, o + 64}, {f, f + 64}};
    fuse::merge_rows(policy, pairs, p.data(), p.data() + n, 32, n / 32);
    for (std::size_t r = 0; r < n / 32; ++r) {
      const std::size_t at = 128 * r, to = 32 * r;
      const fuse::RowPair pair{{o + at, o + at + 64}, {f + at, f + at + 64}};
      fuse::loop::merge_rows(policy, pair, q.data() + to, q.data() + n + to, 32, 1);
    }
    EXPECT_TRUE(same(p, q)) << to_string(policy) << ", rows";
    std::vector<float> s(2 * in.cells()), t(2 * in.cells());
    fuse::split_cells(policy, 3, o, f, s.data(), s.data() + in.cells(), in.cells());
    fuse::loop::split_cells(policy, 3, o, f, t.data(), t.data() + in.cells(), in.cells());
    EXPECT_TRUE(same(s, t)) << to_string(policy);
  }
}

}  // namespace
}  // namespace apgm

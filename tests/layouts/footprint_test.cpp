#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>
#include <unordered_map>

#include "apgm/layouts/memory.hpp"
#include "apgm/layouts/moving_grid.hpp"
#include "apgm/layouts/nonuniform_grid.hpp"
#include "apgm/layouts/submap_grid.hpp"
#include "layouts/allocation.hpp"
#include "support.hpp"

namespace {

/// What the program has taken by `new` and not given back, as the heap accounts for it.
std::atomic<std::int64_t> g_heap_bytes{0};
constexpr std::size_t kSizeBytes = 16;  // before each block: its size, keeping the alignment

void* take(std::size_t bytes) {
  auto* memory = static_cast<std::size_t*>(std::malloc(bytes + kSizeBytes));
  if (memory == nullptr) throw std::bad_alloc();
  *memory = bytes;
  g_heap_bytes += static_cast<std::int64_t>(apgm::layouts::heap_bytes(bytes));
  return reinterpret_cast<char*>(memory) + kSizeBytes;
}

void give(void* memory) noexcept {
  if (memory == nullptr) return;
  auto* block = reinterpret_cast<std::size_t*>(static_cast<char*>(memory) - kSizeBytes);
  g_heap_bytes -= static_cast<std::int64_t>(apgm::layouts::heap_bytes(*block));
  std::free(block);
}

}  // namespace

void* operator new(std::size_t bytes) { return take(bytes); }
void* operator new[](std::size_t bytes) { return take(bytes); }
void operator delete(void* memory) noexcept { give(memory); }
void operator delete[](void* memory) noexcept { give(memory); }
void operator delete(void* memory, std::size_t) noexcept { give(memory); }
void operator delete[](void* memory, std::size_t) noexcept { give(memory); }

namespace apgm {
namespace {

using test::Random;

/// Of the heap, from its making on: what an empty layout takes for itself is left out.
class Account {
 public:
  Account() : start_(g_heap_bytes) {}
  std::int64_t bytes() const { return g_heap_bytes - start_; }

 private:
  std::int64_t start_;
};

class SubMapFootprint : public testing::TestWithParam<SubMapContainer> {};

TEST_P(SubMapFootprint, IsWhatTheHeapGave) {
  Random random(11);
  const auto grid = make_submap_grid(CellSchema(test::paper_types()), Frame{}, 1.6, GetParam(), 80);
  const auto told_before = static_cast<std::int64_t>(grid->footprint().allocated_bytes);
  const Account account;
  for (int i = 0; i < 400; ++i) {
    grid->insert({300 * random.unit() - 150, 300 * random.unit() - 150})[0] = 0.5f;
    if (i % 80 == 79) grid->move_to({100 * random.unit() - 50, 100 * random.unit() - 50});
    if (i % 20 != 0) continue;
    const std::int64_t taken = account.bytes();
    ASSERT_EQ(static_cast<std::int64_t>(grid->footprint().allocated_bytes) - told_before, taken) << i;
  }
  EXPECT_GT(grid->footprint().allocated_bytes, grid->footprint().value_bytes());
}

std::string name_of(const testing::TestParamInfo<SubMapContainer>& info) {
  return std::string(to_string(info.param));
}
INSTANTIATE_TEST_SUITE_P(All, SubMapFootprint, testing::ValuesIn(kSubMapContainers), name_of);

TEST(SnapshotFootprint, OfSharedTilesIsTheTableAlone) {
  const auto grid =
      make_submap_grid(CellSchema(test::paper_types()), Frame{}, 1.6, SubMapContainer::kCowTiles);
  grid->reserve({0, 0, 100'000'000, 100'000'000});
  const Account account;
  const auto copy = grid->snapshot();
  EXPECT_LT(account.bytes(), 4096);
  copy->insert({0, 0});
  EXPECT_GE(account.bytes(), 64 * 24);
  EXPECT_LT(account.bytes(), 4096 + 64 * 24 + 64);
}

TEST(RectangleFootprint, IsWhatTheHeapGave) {
  for (const bool is_moving : {true, false}) {
    const CellSchema schema(test::paper_types());
    NonUniformPlan plan{"one", {{-1, 1, -1, 1, 0.1, 0.1}, {1, 3, -1, 1, 0.2, 0.1}}};
    const auto make = [&] {
      return is_moving ? make_moving_grid(schema, Frame{}, 0.1, 10)
                       : make_nonuniform_grid(schema, Frame{}, plan);
    };
    const Account account;
    const auto grid = make();
    const auto told = static_cast<std::int64_t>(grid->footprint().allocated_bytes);
    // The rest is the object, its schema and its names.
    EXPECT_GT(account.bytes(), told);
    EXPECT_LT(account.bytes(), told + 4096);
    const std::int64_t at_rest = account.bytes();
    grid->move_to({3, 3});
    EXPECT_EQ(account.bytes(), at_rest);
    EXPECT_EQ(static_cast<std::int64_t>(grid->footprint().allocated_bytes), told);
  }
}

TEST(MapFootprint, NodesAreWhatTheHeapGave) {
  MapHeader header;
  header.types = test::paper_types();
  Map map(header);
  const Account account;
  map.layer({0, 0}, 0, 3);
  map.layer({0, 0}, 1, 2);
  map.layer({7, 0}, 1, 4);
  std::uint64_t planes = 0;  // not taken by `new`
  for (const std::uint64_t bytes : {2 * 64 * 4, 4 * 16 * 4, 4 * 256 * 4})
    planes += layouts::heap_bytes(bytes);
  EXPECT_EQ(static_cast<std::int64_t>(footprint(map).allocated_bytes - planes), account.bytes());
}

}  // namespace
}  // namespace apgm

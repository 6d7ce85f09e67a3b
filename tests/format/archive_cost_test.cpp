#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>

#include "archive_support.hpp"

namespace apgm::test {
namespace {

namespace fs = std::filesystem;

int number_from(const char* variable, int otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::atoi(text);
}

/// Bytes this process has read so far.
std::uint64_t bytes_read() {
  std::ifstream io("/proc/self/io");
  std::string name;
  std::uint64_t value = 0;
  io >> name >> value;
  return name == "rchar:" ? value : 0;
}

double seconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

class ArchiveCostTest : public ::testing::Test {
 protected:
  void SetUp() override {
    dir_ = fs::temp_directory_path() / ("apgm_archive_cost_" + std::to_string(::getpid()));
    fs::create_directories(dir_);
  }
  void TearDown() override { fs::remove_all(dir_); }
  fs::path dir_;
};

void draw(Layer& layer, std::mt19937_64& rng) {
  for (std::size_t c = 0; c < layer.cells(); ++c) {
    const float mass = unit(rng);
    layer.plane(0)[c] = c % 3 == 0 ? mass : 0;
    layer.plane(1)[c] = c % 3 == 1 ? mass : 0;
  }
}

TEST_F(ArchiveCostTest, ACommitCostsWhatChanged) {
  const int side = number_from("APGM_ARCHIVE_SIDE", 60);
  std::mt19937_64 rng(1);
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) draw(map.layer({x, y}, 0, 4), rng);
  }
  const int few = side / 10;  // 1 % of the patches: a square, and a lattice
  Map square = map, lattice = map;
  for (int y = 0; y < few; ++y) {
    for (int x = 0; x < few; ++x) {
      draw(square.layer({x + few, y + few}, 0, 4), rng);
      draw(lattice.layer({10 * x + 5, 10 * y + 5}, 0, 4), rng);
    }
  }
  const auto measure = [&](const char* name, const Map& base, const Map& next) {
    const std::string file = (dir_ / "a.apgm").string();
    const std::uint64_t before = fs::exists(file) ? fs::file_size(file) : 0;
    const double seconds = seconds_of([&] { commit_map(file, base, next); });
    const std::uint64_t bytes = fs::file_size(file) - before;
    std::printf("%-8s %10llu bytes %8.1f ms\n", name, static_cast<unsigned long long>(bytes), seconds * 1e3);
    return bytes;
  };
  const std::uint64_t whole = measure("whole", Map(header), map);
  EXPECT_LT(measure("square", map, square), whole / 40);
  EXPECT_LT(measure("lattice", square, lattice), whole / 10);
  const double walk = seconds_of([&] { EXPECT_FALSE(same_content(square, map)); });
  std::printf("of each time about %.1f ms compare maps in memory\n", 2 * walk * 1e3);
}

TEST_F(ArchiveCostTest, OpeningReadsLittle) {
  const int side = number_from("APGM_OPEN_SIDE", 100);
  const std::string file = (dir_ / "large.apgm").string();
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  {
    ArchiveWriter writer(file, {.create = true, .level = 1});
    writer.begin(header);
    std::vector<std::pair<std::uint64_t, PatchIndex>> order;
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) order.emplace_back(curve_key({x, y}), PatchIndex{x, y});
    }
    std::ranges::sort(order, {}, [](const auto& pair) { return pair.first; });
    for (const auto& [key, index] : order) {
      std::vector<Parcel> parcels(1);
      parcels[0].patch = index;
      parcels[0].cells = Layer(header.types[0], 0);
      parcels[0].cells.plane(0)[0] = 0.5f;
      writer.pack(parcels[0]);
      writer.put(index, parcels);
    }
    writer.finish();
  }
  const std::uint64_t before = bytes_read();
  const Reader reader(file);
  const std::uint64_t bytes = bytes_read() - before;
  std::printf("opening %d layers reads %llu bytes of %llu\n", side * side,
              static_cast<unsigned long long>(bytes), static_cast<unsigned long long>(fs::file_size(file)));
  EXPECT_LT(bytes, 1u << 20);
}

}  // namespace
}  // namespace apgm::test

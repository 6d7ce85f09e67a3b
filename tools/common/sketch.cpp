#include "tools/common/sketch.hpp"

#include <algorithm>
#include <cstdint>

namespace apgm::tools {

std::vector<std::string> sketch(const PatchSource& source, std::size_t columns, std::size_t rows) {
  const PatchRange range = source.summary().range;
  if (range.empty() || columns == 0 || rows == 0) return {};
  const auto extent = [](std::int32_t min, std::int32_t max) {
    return static_cast<std::uint64_t>(std::int64_t{max} - min + 1);
  };
  const std::uint64_t wide = extent(range.min.x, range.max.x), high = extent(range.min.y, range.max.y);
  const auto needed = [](std::uint64_t patches, std::uint64_t places) {
    return (patches + places - 1) / places;
  };
  const std::uint64_t side = std::max(needed(wide, columns), needed(high, 2 * rows));
  const std::size_t width = needed(wide, side), height = needed(high, side);
  std::vector<std::uint8_t> taken(width * height);
  PatchInfo info;
  for (const auto cursor = source.patches(); cursor->next(info);) {
    const auto x = static_cast<std::uint64_t>(std::int64_t{info.patch.x} - range.min.x) / side;
    const auto y = static_cast<std::uint64_t>(std::int64_t{info.patch.y} - range.min.y) / side;
    if (x < width && y < height) taken[y * width + x] = 1;
  }
  std::vector<std::string> lines;
  const std::size_t top = (height + 1) / 2 * 2;
  for (std::size_t y = top; y >= 2; y -= 2) {
    std::string line;
    for (std::size_t x = 0; x < width; ++x) {
      const bool upper = y - 1 < height && taken[(y - 1) * width + x] != 0;
      const bool lower = taken[(y - 2) * width + x] != 0;
      line += upper ? (lower ? "█" : "▀") : (lower ? "▄" : " ");
    }
    lines.push_back(std::move(line));
  }
  return lines;
}

}  // namespace apgm::tools

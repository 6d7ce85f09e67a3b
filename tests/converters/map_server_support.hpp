#pragma once

#include <cmath>
#include "converters/map_server/map_server.hpp"

#include "tests/converters/support.hpp"

namespace apgm::converters::testing {

struct YamlText {
  std::string image = "a.pgm";
  std::string mode = "trinary";
  std::string resolution = "0.1";
  std::string origin = "[0.0, 0.0, 0.0]";
  std::string negate = "0";
  std::string occupied_thresh = "0.65";
  std::string free_thresh = "0.196";

  std::string text() const {
    const auto line = [](const char* key, const std::string& value) {
      return value.empty() ? "" : std::string(key) + ": " + value + "\n";
    };
    return line("image", image) + line("mode", mode) + line("resolution", resolution) +
           line("origin", origin) + line("negate", negate) + line("occupied_thresh", occupied_thresh) +
           line("free_thresh", free_thresh);
  }
};

/// Writes both files and gives the YAML's path.
inline std::string save_map(const TempDir& dir, const YamlText& yaml, const std::string& picture) {
  write_text(dir / yaml.image, picture);
  return write_text(dir / "map.yaml", yaml.text());
}

/// 3 x 2 pixels, the upper row first.
inline std::string p5(const std::vector<int>& pixels, int width = 3) {
  std::string bytes = "P5\n# comment\n" + std::to_string(width) + " " +
                      std::to_string(pixels.size() / static_cast<std::size_t>(width)) + "\n255\n";
  for (const int v : pixels) bytes += static_cast<char>(v);
  return bytes;
}

/// BetP(O) of the cells of a map with 0.1 m cells and its datum at the lower-left pixel; the upper row first,
/// -1 for cells without data.
inline std::vector<double> beliefs(const Map& map, int width = 3, int height = 2) {
  std::vector<double> values;
  const Point datum = map.header().frame.datum_m();
  for (int y = height - 1; y >= 0; --y) {
    for (int x = 0; x < width; ++x) {
      const auto [o, f] =
          masses_at(map, "occupancy", datum.x_m + x * 0.1 + 0.05, datum.y_m + y * 0.1 + 0.05, 7);
      values.push_back(o == 0 && f == 0 ? -1 : std::round((0.5 + (o - f) / 2) * 1e6) / 1e6);
    }
  }
  return values;
}

}  // namespace apgm::converters::testing

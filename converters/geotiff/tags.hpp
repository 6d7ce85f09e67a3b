#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "apgm/core/source.hpp"

namespace apgm::converters {

/// What a GeoTIFF of this project says of its map beside the pixels: metadata domain "APGM", one item a
/// member. Where the raster lies is said by its coordinates alone, so that a cut raster stays right.
struct MapTags {
  bool classes = false;  ///< pixels are numbers of hypotheses from 1, else values of channels
  LayerType type;
  Frame frame;
  int step = 0;
  std::int64_t stamp_ns = 0;                     ///< of the map
  std::optional<double> class_mass;              ///< mass a class stands for
  std::map<PatchIndex, std::int64_t> stamps_ns;  ///< of the layers that say one
};

/// More stamps than these are not written.
inline constexpr std::size_t kMostStamps = 65536;

std::map<std::string, std::string> to_items(const MapTags& tags);
/// @return nullopt if there is no item at all
/// @throws Error{kDamaged} if an item is missing or cannot be read, {kUnsupported} on another version
std::optional<MapTags> from_items(const std::map<std::string, std::string>& items);

}  // namespace apgm::converters

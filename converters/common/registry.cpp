#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>

#include "converters/common/converter.hpp"
#include "converters/common/file.hpp"

#include "converters/fixed_grid/fixed_grid.hpp"
#ifdef APGM_HAS_GEOTIFF
#include "converters/geotiff/geotiff.hpp"
#endif
#ifdef APGM_HAS_MAP_SERVER
#include "converters/map_server/map_server.hpp"
#endif
#ifdef APGM_HAS_NUMPY
#include "converters/numpy/numpy.hpp"
#endif
#ifdef APGM_HAS_OCTOMAP
#include "converters/octomap/octomap.hpp"
#endif

namespace apgm::converters {

const std::vector<const Converter*>& all() {
  static const std::vector<const Converter*> converters{
      &fixed_grid(),
#ifdef APGM_HAS_GEOTIFF
      &geotiff(),
#endif
#ifdef APGM_HAS_MAP_SERVER
      &map_server(),
#endif
#ifdef APGM_HAS_NUMPY
      &numpy(),
#endif
#ifdef APGM_HAS_OCTOMAP
      &octomap(),
#endif
  };
  return converters;
}

const Converter* find(std::string_view name) {
  const auto& list = all();
  const auto it = std::ranges::find(list, name, &Converter::name);
  return it == list.end() ? nullptr : *it;
}

const Converter* sniff(const std::string& path, std::span<const std::byte> head) {
  for (const Converter* converter : all()) {
    if (converter->can_read() && converter->sniffs(path, head)) return converter;
  }
  return nullptr;
}

const Converter* sniff(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::array<char, 4096> head{};
  in.read(head.data(), head.size());
  const auto bytes = std::as_bytes(std::span(head.data(), static_cast<std::size_t>(in.gcount())));
  return sniff(path, bytes);
}

const Converter* for_extension(const std::string& path) {
  const std::string extension = extension_of(path);
  for (const Converter* converter : all()) {
    const auto known = converter->extensions();
    if (converter->can_write() && std::ranges::find(known, extension) != known.end()) return converter;
  }
  return nullptr;
}

}  // namespace apgm::converters

#include "big_map.hpp"

#include <algorithm>
#include <cmath>

#include "apgm/format/writer.hpp"

namespace apgm::test {
namespace {

/// Walls on a free ground, in a few masses: no layer is constant.
void fill_occupancy(Layer& layer, int pattern) {
  for (int b = 0; b < layer.side(); ++b) {
    for (int a = 0; a < layer.side(); ++a) {
      const bool wall = (a + pattern) % 32 == 0 || (b + 3 * pattern) % 48 == 0;
      const float mass = static_cast<float>(64 + (a / 4 + b / 8 + pattern) % 128) / 256.0f;
      layer.at(wall ? 0 : 1, {a, b}) = mass;
    }
  }
}

void fill_heights(Layer& layer, int pattern) {
  for (int b = 0; b < layer.side(); ++b) {
    for (int a = 0; a < layer.side(); ++a) {
      layer.at(0, {a, b}) = static_cast<float>((a / 8 + b / 8 + pattern) % 64);
    }
  }
}

std::uint64_t patch_bytes(const BigMap& map) {
  return (std::uint64_t{sizeof(float)} << (2 * map.step)) * (map.heights ? 3 : 2);
}

}  // namespace

int BigMap::side() const {
  const double patches = static_cast<double>(value_bytes) / static_cast<double>(patch_bytes(*this));
  return std::max(1, static_cast<int>(std::ceil(std::sqrt(patches))));
}

void BigMap::write(const std::string& path) const {
  MapHeader header;
  header.frame.frame_id = "map";
  header.frame.datum_x_um = header.frame.datum_y_um = datum_um;
  std::vector<LayerType> types{LayerType::occupancy()};
  if (heights) types.insert(types.begin(), LayerType::real("height", {"z"}));
  header.types = TypeTable(std::move(types));

  std::vector<PatchIndex> patches;
  for (int y = 0; y < side(); ++y) {
    for (int x = 0; x < side(); ++x) patches.push_back({x, y});
  }
  std::ranges::sort(patches, {}, curve_key);
  Writer writer(path, header);
  std::vector<Parcel> parcels(header.types.size());
  for (const PatchIndex patch : patches) {
    for (std::size_t t = 0; t < parcels.size(); ++t) {
      Parcel& parcel = parcels[t];
      parcel.patch = patch;
      parcel.type = static_cast<TypeId>(t);
      parcel.state = Parcel::State::kCells;
      const LayerType& type = header.types[parcel.type];
      parcel.cells.reset(type, step);
      const int own = (pattern + patch.x + 7 * patch.y) % 16;
      type.is_occupancy() ? fill_occupancy(parcel.cells, own) : fill_heights(parcel.cells, own);
      writer.pack(parcel);
    }
    writer.put(patch, parcels);
  }
  writer.finish();
}

}  // namespace apgm::test

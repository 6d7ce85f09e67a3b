#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "apgm/core/map.hpp"
#include "apgm/core/map_changes.hpp"
#include "apgm/observe/mapper.hpp"
#include "fuse/spare_layers.hpp"

namespace apgm::observe {

/// The patches a Mapper has in memory, with what changed since the last look and totals by type.
class LiveMap {
 public:
  /// @param spare_bytes  most memory that is kept of layers that left
  LiveMap(MapHeader header, std::size_t spare_bytes);

  const Map& map() const { return map_; }
  const TypeTable& types() const { return map_.header().types; }
  /// Layers keep their type's name. @throws Error as Map::set_types
  void set_types(const TypeTable& types);

  Layer* find(PatchIndex index, TypeId type);
  /// A new layer, without data.
  Layer& insert(PatchIndex index, TypeId type, int step);
  Layer& insert(PatchIndex index, TypeId type, Layer&& layer);
  /// Takes an existing layer out.
  Layer extract(PatchIndex index, TypeId type);
  void drop(PatchIndex index, TypeId type) { spare(extract(index, type)); }
  /// Memory that may be used again.
  void spare(Layer&& layer) { spares_.keep(std::move(layer)); }
  /// Brings a layer to `step` by the policy of its type.
  void resample(PatchIndex index, TypeId type, int step);

  /// The cells of a layer are others now.
  void mark(PatchIndex index, TypeId type);
  /// The patch was used in call number `call`.
  void touch(PatchIndex index, std::uint64_t call);
  /// Those in memory, the least recently used first, then by key; those of call number `call` against the
  /// order of their keys, since the next call looks at the first of them first.
  std::vector<PatchIndex> by_last_use(std::uint64_t call) const;
  std::vector<PatchIndex> indices() const;

  MapChanges take_changes();

  /// Layers, cells and bytes by type.
  const std::vector<MapperReport::OfType>& totals() const { return totals_; }
  std::uint64_t value_bytes() const;

 private:
  struct Notes {
    std::uint64_t last_use = 0;
    std::vector<TypeId> changed;
  };
  void count(TypeId type, const Layer& layer, bool in);

  Map map_;
  std::map<std::uint64_t, Notes> notes_;                              // by curve_key, of the patches in map_
  std::map<std::pair<std::uint64_t, TypeId>, PatchIndex> last_look_;  // layers that were there
  std::vector<MapperReport::OfType> totals_;
  fuse::SpareLayers spares_;
};

}  // namespace apgm::observe

#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "apgm/core/layer.hpp"
#include "apgm/core/source.hpp"

namespace apgm {

/// A patch (paper, p_(ix,iy)): at most one layer a type, sorted by type.
struct Patch {
  PatchIndex index;
  std::map<TypeId, Layer> layers;
};

/// A whole map in memory: a set of patches in key order, at once a source and (through MapSink) a sink.
///
/// Thread rule: const members from any thread, others from one.
class Map final : public PatchSource {
 public:
  explicit Map(MapHeader header);

  /// The patch at `index`, made when absent.
  Patch& patch(PatchIndex index);
  const Patch* find(PatchIndex index) const;
  /// The layer of `type` at `index`, made (vacuous, at `step`) when absent; an existing one keeps its step.
  Layer& layer(PatchIndex index, TypeId type, int step);
  const Layer* find(PatchIndex index, TypeId type) const;
  /// Removes layers without data and patches without layers (paper, Sec. III-A).
  void prune();
  /// Takes the layer, if any, out of the map; a patch without layers goes too.
  std::optional<Layer> extract(PatchIndex index, TypeId type);
  /// Takes other types, a superset by name: layers follow their type's name to its new id.
  /// @throws Error{kIncompatible} if a type is missing or of another space or background; the map is then
  /// unchanged
  void set_types(const TypeTable& types);
  void set_stamp_ns(std::int64_t stamp_ns) { header_.stamp_ns = stamp_ns; }
  std::size_t size() const { return patches_.size(); }
  const std::map<std::uint64_t, Patch>& by_key() const { return patches_; }

  const MapHeader& header() const override { return header_; }
  Summary summary() const override;
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override;
  void load(const LayerInfo& info, Layer& out) const override;

 private:
  MapHeader header_;
  std::map<std::uint64_t, Patch> patches_;  // by curve_key
};

/// Collects a stream of patches into a Map.
class MapSink final : public PatchSink {
 public:
  explicit MapSink(Map& map) : map_(map) {}
  void pack(Parcel& parcel) const override;
  void put(PatchIndex index, std::span<Parcel> parcels) override;
  void finish() override {}

 private:
  Map& map_;
};

}  // namespace apgm

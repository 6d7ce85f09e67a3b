#pragma once

#include <atomic>
#include <cstring>

#include "apgm/core/error.hpp"
#include "apgm/core/map.hpp"

namespace apgm::test {

/// A map that pretends to be a file: layers can be had as stored bytes, and damaged ones fail their check.
class StoredSource final : public PatchSource {
 public:
  explicit StoredSource(const Map& map) : map_(map) {}
  const MapHeader& header() const override { return map_.header(); }
  Summary summary() const override { return map_.summary(); }
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override {
    return map_.patches(range);
  }
  void load(const LayerInfo& info, Layer& out) const override {
    check(info);
    ++loads;
    map_.load(info, out);
  }
  bool load_stored(const LayerInfo& info, StoredLayer& out) const override {
    check(info);
    ++stored_loads;
    const Layer& layer = *map_.find(info.patch, info.type);
    out.step = static_cast<std::uint8_t>(layer.step());
    out.bytes.resize(layer.value_bytes());
    std::byte* to = out.bytes.data();
    for (int c = 0; c < layer.channels(); ++c) {
      const auto plane = layer.plane(c);
      std::memcpy(to, plane.data(), plane.size_bytes());
      to += plane.size_bytes();
    }
    return true;
  }

  std::optional<PatchIndex> damaged;
  mutable std::atomic<int> loads{0}, stored_loads{0};

 private:
  void check(const LayerInfo& info) const {
    if (damaged == info.patch) throw Error(ErrorCode::kDamaged, "a layer fails its checksum");
  }
  const Map& map_;
};

/// Takes stored bytes of a StoredSource as well as cells.
class StoredSink final : public PatchSink {
 public:
  explicit StoredSink(Map& map) : map_(map), cells_(map) {}
  bool takes_stored() const override { return true; }
  void pack(Parcel& parcel) const override {
    if (parcel.state == Parcel::State::kCells) cells_.pack(parcel);
  }
  void put(PatchIndex index, std::span<Parcel> parcels) override {
    for (Parcel& parcel : parcels) {
      if (parcel.state != Parcel::State::kStored) continue;
      const LayerType& type = map_.header().types[parcel.type];
      parcel.cells.reset(type, parcel.stored.step);
      const std::byte* from = parcel.stored.bytes.data();
      for (int c = 0; c < parcel.cells.channels(); ++c) {
        const auto plane = parcel.cells.plane(c);
        std::memcpy(plane.data(), from, plane.size_bytes());
        from += plane.size_bytes();
      }
      parcel.state = Parcel::State::kCells;
    }
    cells_.put(index, parcels);
  }
  void finish() override {}

 private:
  Map& map_;
  MapSink cells_;
};

}  // namespace apgm::test

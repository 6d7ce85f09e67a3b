#pragma once

#include <span>
#include <utility>
#include <vector>

#include "apgm/format/writer.hpp"

namespace apgm::bench {

/// Packs and writes all of them through one StoredLayer, and finishes.
inline void write_parcels(Writer& writer, std::vector<Parcel>& parcels, StoredLayer& stored) {
  for (Parcel& parcel : parcels) {
    parcel.state = Parcel::State::kCells;
    parcel.stored = std::move(stored);
    writer.pack(parcel);
    writer.put(parcel.patch, std::span(&parcel, 1));
    stored = std::move(parcel.stored);
  }
  writer.finish();
}

}  // namespace apgm::bench

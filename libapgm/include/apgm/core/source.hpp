#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apgm/core/frame.hpp"
#include "apgm/core/layer.hpp"
#include "apgm/core/layer_type.hpp"

namespace apgm {

/// One step in a map's history. Holds no clock, host or path.
struct Provenance {
  std::string operation;            ///< "merge", "crop", "convert", ...
  std::vector<std::string> inputs;  ///< content ids of the inputs (32 hex digits), or a format's name
  std::string parameters;           ///< JSON object, one line
  friend bool operator==(const Provenance&, const Provenance&) = default;
};

/// What is known of a map before any of its patches is read.
struct MapHeader {
  Frame frame;
  TypeTable types;
  std::map<std::string, std::string> metadata;  ///< free key/value pairs, UTF-8, e.g. "octomap.resolution"
  std::vector<Provenance> history;              ///< oldest first
  std::int64_t stamp_ns = 0;                    ///< 0: not said
};

/// A layer of a source that has not been read: cheap to copy, enough to plan with.
struct LayerInfo {
  PatchIndex patch;
  TypeId type = 0;  ///< in the table of the source it came from
  std::uint8_t step = 0;
  std::uint8_t encoding = 0;       ///< as stored; 0 where a source stores nothing
  std::uint32_t stored_bytes = 0;  ///< size where it is stored, 0 for sources in memory
  std::uint64_t content_hash =
      0;  ///< over step and cells, equal for equal cells; 0: not known before reading
  std::int64_t stamp_ns = 0;
  std::uint64_t locator = 0;  ///< for the source alone
};

/// The layers of one patch, sorted by type.
struct PatchInfo {
  PatchIndex patch;
  std::vector<LayerInfo> layers;
};

/// Walks the patches of a source in ascending curve_key. Must not outlive its source. One thread.
class PatchCursor {
 public:
  virtual ~PatchCursor() = default;
  /// The next patch in `out`, false at the end. Reuses the memory of `out`.
  /// @throws Error{kDamaged|kUnreadable}
  virtual bool next(PatchInfo& out) = 0;
};

/// Totals of a source, known without reading layers.
struct Summary {
  struct OfType {
    std::uint64_t layers = 0;
    std::uint64_t stored_bytes = 0;
    std::uint64_t raw_bytes = 0;                          ///< float32 values
    std::array<std::uint64_t, kMaxStep + 1> layers_at{};  ///< by step
    friend bool operator==(const OfType&, const OfType&) = default;
  };
  std::uint64_t patches = 0;
  PatchRange range;           ///< of patch indices; empty for an empty map
  std::vector<OfType> types;  ///< by TypeId
};

/// Bytes of a layer as a sink stores them, opaque to all but the format that made them.
struct StoredLayer {
  std::uint8_t encoding = 0;
  std::uint8_t step = 0;
  std::uint64_t content_hash = 0;
  float error_bound = 0;  ///< stated bound of a lossy encoding; 0: every bit is kept
  std::vector<std::byte> bytes;
};

/// Where patches come from: a file, a map in memory, a foreign format.
///
/// Thread rule: const members from any thread at the same time; a cursor from one.
class PatchSource {
 public:
  virtual ~PatchSource() = default;
  virtual const MapHeader& header() const = 0;
  virtual Summary summary() const = 0;
  /// A walk over all patches, or those in `range`.
  virtual std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const = 0;
  /// Reads the cells of a layer a cursor named.
  /// @throws Error{kDamaged|kUnreadable}; `out` then holds unspecified cells
  virtual void load(const LayerInfo& info, Layer& out) const = 0;
  /// The stored bytes of a layer, checked but not decoded; false where the source stores none.
  virtual bool load_stored(const LayerInfo& /*info*/, StoredLayer& /*out*/) const { return false; }
  /// Identity of the whole content, 32 hex digits; empty where it is not known without reading all.
  virtual std::string content_id() const { return {}; }
};

/// One layer on its way to a sink. `type` counts in the sink's table.
struct Parcel {
  PatchIndex patch;
  TypeId type = 0;
  std::int64_t stamp_ns = 0;
  enum class State : std::uint8_t {
    kCells,   ///< `cells` holds the layer
    kStored,  ///< `stored` holds the layer
    kNothing  ///< the layer turned out to hold no data, and is dropped
  } state = State::kCells;
  Layer cells;
  StoredLayer stored;
};

/// Where patches go. `pack` does the heavy part on any thread, `put` the ordered part on one.
class PatchSink {
 public:
  virtual ~PatchSink() = default;
  /// True if `pack` takes parcels of state kStored, as `load_stored` of an .apgm file filled them. A sink
  /// that keeps cells or another format says false and is given cells only.
  virtual bool takes_stored() const { return false; }
  /// Makes a parcel ready for `put`: canonicalises, drops the vacuous, encodes. Thread-safe.
  /// @throws Error{kInvalidArgument} on masses out of range
  virtual void pack(Parcel& parcel) const = 0;
  /// Takes the packed layers of one patch, sorted by type; patches come in strictly ascending curve_key.
  virtual void put(PatchIndex index, std::span<Parcel> parcels) = 0;
  /// Must be called once, after the last patch; what was put does not count before.
  virtual void finish() = 0;
};

}  // namespace apgm

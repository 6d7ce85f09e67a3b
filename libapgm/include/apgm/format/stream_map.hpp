#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "apgm/core/source.hpp"
#include "apgm/format/stream.hpp"

namespace apgm {

/// The map a stream makes, kept in a file without a name: give it to a StreamReader, and read it as any
/// source. Layers are decoded once as they arrive, so that what is kept is whole; memory is some 250 bytes a
/// layer.
///
/// A new map header takes the layers with it whose types it lacks or changes, with another frame all of them.
/// The end of a whole map, of which nothing is missing, takes those that the message did not hold.
/// Thread rule: as PatchSource while nothing arrives.
class StreamMap final : public StreamHandler, public PatchSource {
 public:
  /// @param directory  where the file lies; nothing is visible there
  explicit StreamMap(std::string directory);
  ~StreamMap() override;

  /// Before anything arrives: the map that the stream's messages change, copied. Whether it is the right one
  /// is known by `base`.
  /// @throws Error as PatchSource::load and ScratchMap::put
  void start_from(const PatchSource& base);

  /// @throws Error{kOutput} if the disk is full
  void header(const MapHeader& header) override;
  void layer(const StreamLayer& layer) override;
  void gone(const StreamGone& gone) override;
  void end(const StreamEnd& end) override;

  /// A map header arrived: before, the map below is empty and of no frame.
  bool has_header() const;
  /// Layers that did not hold what their block says, or did not fit the header: left out.
  std::uint64_t unusable() const;
  /// The map that the first message changes; empty: none is said.
  const std::string& base() const;
  /// The map that the last message leads to; empty: not said.
  const std::string& result() const;
  /// The map is the one that the last message said: nothing was lost. nullopt: it said none. Walks the index.
  std::optional<bool> is_as_said() const;

  const MapHeader& header() const override;
  Summary summary() const override;
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override;
  void load(const LayerInfo& info, Layer& out) const override;
  bool load_stored(const LayerInfo& info, StoredLayer& out) const override;
  std::string content_id() const override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace apgm

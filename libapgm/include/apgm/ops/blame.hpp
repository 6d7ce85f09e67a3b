#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apgm/core/source.hpp"

namespace apgm {

/// What a map knows of a point: one cell of one layer that holds data there.
struct KnownCell {
  LayerType type;
  int step = 0;
  std::int64_t stamp_ns = 0;
  std::vector<float> values;  ///< by channel
};

/// The cells that hold `point`, in metres of the map's CRS; none where the map holds no data.
/// @throws Error{kInvalidArgument} if `point` is not finite, and as PatchSource::load
std::vector<KnownCell> known_cells(const PatchSource& map, Point point);

struct BlameInput {
  const PatchSource* source = nullptr;
  std::string name;
};

/// A map that the history leads to.
struct Ancestor {
  std::string id;                          ///< content id, or a format's name, as the history has it
  std::shared_ptr<const Provenance> step;  ///< what it went into; shared by all of that step
  int depth = 1;                           ///< steps between it and the map
  std::optional<std::size_t> input;        ///< that has this content id; empty: none was given
  std::vector<KnownCell> cells;            ///< of that input
};

struct Blame {
  std::vector<KnownCell> cells;  ///< of the map
  std::vector<Ancestor>
      ancestors;  ///< those of the last step first, each followed by its own; each content id once
  std::vector<std::size_t> strangers;  ///< inputs that the history does not name
};

/// Who observed a point: follows the history of `map` to the maps it was made of, and looks into those that
/// are among `inputs`. A history tells the content ids of its maps alone; the history of an input goes on
/// from there, else that of the map before the step. Where all histories end, the answer ends.
/// Reads one patch of each input.
Blame blame(const PatchSource& map, Point point, const std::vector<BlameInput>& inputs);

}  // namespace apgm

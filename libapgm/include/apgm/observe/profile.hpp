#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "apgm/core/frame.hpp"
#include "apgm/core/layer_type.hpp"
#include "apgm/core/polygon.hpp"

namespace apgm {

/// The ring from_m <= distance <= to_m round the vehicle; from_m = 0: a disc.
struct Ring {
  double from_m = 0;
  double to_m = 0;
  friend bool operator==(const Ring&, const Ring&) = default;
};

/// "Layers of this type, in this area, with cells no larger than that" (docs/theory.md, "Requirements").
struct Requirement {
  std::string layer;
  double cell_m = 0;                 ///< edge / 2^r for some r
  std::variant<Ring, Polygon> area;  ///< a polygon lies fixed in the map's CRS
};

/// The requirements of one situation.
struct Profile {
  std::string name;
  std::vector<Requirement> requirements;

  /// r_req: the greatest step among the requirements on `layer` whose area meets the closed square of
  /// `patch`; nullopt if none does: the layer is not wanted there.
  std::optional<int> required_step(const Frame& frame, PatchIndex patch, std::string_view layer,
                                   Point vehicle) const;
  /// Patches that any requirement may want, a superset that is tight for discs.
  PatchRange reach(const Frame& frame, Point vehicle) const;
  /// @throws Error{kInvalidArgument} on a layer that is not in `types`, a cell size that is no power-of-two
  /// part of the edge, rings of one layer that overlap, a polygon without area
  void check(const Frame& frame, const TypeTable& types) const;
};

/// Profiles and when each begins to hold, in seconds since the first measurement; the first at 0.
struct Schedule {
  struct Entry {
    double from_s = 0;
    Profile profile;
  };
  std::vector<Entry> entries;  ///< ascending in from_s
  /// The profile that holds at `t_s`.
  const Profile& at(double t_s) const;
};

/// Reads one profile (`requirements:`) or several (`profiles:`), as docs/observe.md says.
/// @throws Error{kInvalidArgument} with line and key
Schedule parse_profiles(std::string_view yaml, std::string_view name);

}  // namespace apgm

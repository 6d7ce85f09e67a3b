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

  /// @throws Error{kInvalidArgument} on a layer that is not in `types`, a cell size that is no power-of-two
  /// part of the edge or at which a layer would exceed Layer::kMaxBytes, a ring that is empty or ends beyond
  /// 1e6 m, rings of one layer that overlap (touching is fine), a polygon without rings or with a ring whose
  /// corners, in whole micrometres, all lie on one line (that rings cancel out is not looked at)
  void check(const Frame& frame, const TypeTable& types) const;
};

/// A profile made ready for the patches of a frame: for questions about many patches. Decisions are exact,
/// with the vehicle, radii and corners of patches in whole nanometres.
class ProfileInFrame {
 public:
  /// @throws Error as Frame::step_for and PolygonArea, {kInvalidArgument} on a ring out of range; not if
  ///         Profile::check has passed
  ProfileInFrame(const Profile& profile, const Frame& frame);

  /// r_req: the greatest step among the requirements on `layer` whose area meets `patch`; nullopt if none
  /// does: the layer is not wanted there. A ring meets a patch whose closed square has a point in it, a
  /// polygon one that it shares area with.
  /// @throws Error{kInvalidArgument|kLimit} if `vehicle` is not finite or outside all patches
  std::optional<int> required_step(PatchIndex patch, std::string_view layer, Point vehicle) const;
  /// Patches that any requirement may want, a superset that is tight for discs.
  PatchRange reach(Point vehicle) const;

 private:
  struct Area {
    std::string layer;
    int step = 0;
    std::variant<Ring, PolygonArea> shape;
  };
  Frame frame_;
  std::vector<Area> areas_;
};

/// Profiles and when each begins to hold, in seconds since the first measurement; the first at 0.
struct Schedule {
  struct Entry {
    double from_s = 0;
    Profile profile;
  };
  std::vector<Entry> entries;  ///< ascending in from_s
  /// The profile that holds at `t_s`; before 0 the first. @throws Error{kInvalidArgument} without entries
  const Profile& at(double t_s) const;
};

/// Reads one profile (`requirements:`) or several (`profiles:`), as docs/observe.md says.
/// @throws Error{kInvalidArgument} with line and key
Schedule parse_profiles(std::string_view yaml, std::string_view name);

}  // namespace apgm

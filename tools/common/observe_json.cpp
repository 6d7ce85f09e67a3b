#include "tools/common/observe_json.hpp"

namespace apgm::tools {

Json models_json(const Models& models) {
  const RangeLimits& limits = models.limits;
  Json json = {{"min_range_m", limits.min_range_m},
               {"max_range_m", limits.max_range_m},
               {"no_return_clears_m", limits.no_return_clears_m},
               {"heights_m", {limits.z_min_m, limits.z_max_m}}};
  if (models.kind == ModelKind::kNuss) {
    json["nuss"] = {{"occ_max", models.nuss.occ_max},
                    {"sigma_m", models.nuss.sigma_m},
                    {"free_max", models.nuss.free_max},
                    {"free_range_m", models.nuss.free_range_m}};
  } else {
    json["richter"] = {{"p_fn", models.richter.p_fn}, {"p_fp", models.richter.p_fp}};
  }
  return json;
}

Json schedule_json(const Schedule& schedule) {
  Json list = Json::array();
  for (const Schedule::Entry& entry : schedule.entries) {
    Json wanted = Json::array();
    for (const Requirement& r : entry.profile.requirements) {
      Json one = {{"layer", r.layer}, {"cell_m", r.cell_m}};
      if (const Ring* ring = std::get_if<Ring>(&r.area)) {
        one["ring_m"] = {ring->from_m, ring->to_m};
      } else {
        Json rings = Json::array();
        for (const auto& corners : std::get<Polygon>(r.area).rings) {
          Json points = Json::array();
          for (const Point& p : corners) points.push_back({p.x_m, p.y_m});
          rings.push_back(points);
        }
        one["polygon_m"] = rings;
      }
      wanted.push_back(one);
    }
    list.push_back({{"from_s", entry.from_s}, {"name", entry.profile.name}, {"requirements", wanted}});
  }
  return list;
}

}  // namespace apgm::tools

#include "apgm/observe/model.hpp"

#include <algorithm>
#include <string>

#include "apgm/core/error.hpp"
#include "observe/parameters.hpp"

namespace apgm {
namespace {

void check_parameters(Models models) {
  for (const observe::Parameter& p : observe::parameters(models)) {
    if (p.holds(*p.value)) continue;
    throw Error(ErrorCode::kInvalidArgument, "key '" + std::string(p.key) + "' of '" +
                                                 std::string(p.section) + "' " +
                                                 observe::out_of_range(*p.value))
        .hint(p.range());
  }
}

}  // namespace

LayerType Models::occupancy_type() const {
  return LayerType::occupancy(occupancy_layer,
                              kind == ModelKind::kNuss ? Policy::kExclusive : Policy::kConditional);
}

LayerType Models::semantic_type() const { return LayerType::semantic(semantic_layer, classes); }

void Models::check() const {
  check_parameters(*this);
  if (!(limits.min_range_m < limits.max_range_m)) {
    throw Error(ErrorCode::kInvalidArgument, "key 'min_range_m' of 'limits' is not below max_range_m");
  }
  if (!(limits.z_min_m < limits.z_max_m)) {
    throw Error(ErrorCode::kInvalidArgument, "key 'z_min_m' of 'limits' is not below z_max_m");
  }
  if (occupancy_layer == semantic_layer) {
    throw Error(ErrorCode::kInvalidArgument,
                "keys 'occupancy_layer' and 'semantic_layer' name the same layer");
  }
  for (std::size_t i = 1; i < classes.size(); ++i) {
    if (std::find(classes.begin(), classes.begin() + static_cast<long>(i), classes[i]) !=
        classes.begin() + static_cast<long>(i)) {
      throw Error(ErrorCode::kInvalidArgument, "key 'classes' names '" + classes[i] + "' twice");
    }
  }
  occupancy_type().check();
  semantic_type().check();
}

}  // namespace apgm

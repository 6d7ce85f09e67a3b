#include "type_twins.hpp"

namespace apgm::ops {

std::vector<TypeTwin> type_twins(const TypeTable& from, const TypeTable& to) {
  std::vector<TypeTwin> twins;
  twins.reserve(from.size());
  for (const LayerType& type : from) {
    TypeTwin twin{to.find(type.name), false};
    if (twin.type) twin.same_meaning = to[*twin.type].same_meaning(type);
    twins.push_back(twin);
  }
  return twins;
}

}  // namespace apgm::ops

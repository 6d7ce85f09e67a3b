#include "type_twins.hpp"

#include "transfer.hpp"

namespace apgm::ops {

std::vector<TypeTwin> type_twins(const TypeTable& from, const TypeTable& to) {
  std::vector<TypeTwin> twins;
  twins.reserve(from.size());
  for (const LayerType& type : from) {
    TypeTwin twin{to.find(type.name), false};
    if (twin.type) {
      const LayerType& other = to[*twin.type];
      twin.same_meaning = other.same_space(type) && same_backgrounds(other, type);
    }
    twins.push_back(twin);
  }
  return twins;
}

}  // namespace apgm::ops

#include "recover_plan.hpp"

namespace apgm::format {
namespace {

constexpr std::uint16_t kNoType = 0xffff;  // a table holds at most 4096

}  // namespace

/// The last table of each commit whose header is whole.
void RecoverPlan::read_tables() {
  for (const auto& [commit, block] : header_of_) {
    check_cancelled();
    try {
      read_table(commit, read_header(block).types);
    } catch (const Error& e) {
      if (e.code() == ErrorCode::kUnreadable) throw;
    }
  }
  if (table_of_.empty()) read_table(newest_, header.types);
}

/// Keeps of it no more than the numbers its types have in the map; tables that are alike once.
void RecoverPlan::read_table(std::uint64_t commit, const TypeTable& types) {
  Numbers numbers;
  for (const LayerType& type : types) {
    const auto number = static_cast<std::uint16_t>(numbers.size());
    const auto id = header.types.find(type.name);
    numbers.push_back(id && header.types[*id].same_meaning(type) ? *id : kNoType);
    const auto [at, is_new] = agreed_.try_emplace(number, Agreed{type, false});
    if (!is_new && !at->second.type.same_meaning(type)) at->second.differs = true;
  }
  table_of_[commit] = &*tables_.insert(std::move(numbers)).first;
}

/// A layer's type counts in the table of its commit. Where that is lost, it is known only if all others
/// agree.
std::optional<std::uint16_t> RecoverPlan::type_in_map(const FoundLayer& layer) const {
  const std::uint16_t number = layer.info.type;
  std::uint16_t id = kNoType;
  if (const auto own = table_of_.find(layer.commit); own != table_of_.end()) {
    if (number < own->second->size()) id = (*own->second)[number];
  } else if (const auto agreed = agreed_.find(number); agreed != agreed_.end() && !agreed->second.differs) {
    const LayerType& type = agreed->second.type;
    const auto found = header.types.find(type.name);
    if (found && header.types[*found].same_meaning(type)) id = *found;
  }
  if (id == kNoType) return std::nullopt;
  return id;
}

}  // namespace apgm::format

#include "apgm/core/layer_type.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

constexpr std::array<std::string_view, 11> kPolicyNames{"exclusive", "conditional", "min",      "product",
                                                        "median",    "dempster",    "evidence", "mean",
                                                        "sum",       "minimum",     "maximum"};

bool is_word(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

void check_name(const std::string& name, const char* what) {
  const bool valid = !name.empty() && name.size() <= 64 && is_word(name[0]) &&
                     std::all_of(name.begin(), name.end(),
                                 [](char c) { return is_word(c) || c == '.' || c == '+' || c == '-'; });
  if (valid) return;
  throw Error(ErrorCode::kInvalidArgument, std::string("a ") + what + " name is not usable")
      .hint("use 1 to 64 letters, digits, '_', '.', '+' or '-', not starting with a sign");
}

bool fits(Policy policy, const LayerType& type) {
  switch (policy) {
    case Policy::kExclusive:
    case Policy::kConditional:
    case Policy::kMin:
    case Policy::kProduct:
    case Policy::kMedian:
    case Policy::kDempster:
      return type.is_occupancy();
    case Policy::kEvidence:
      return type.stores_omega();
    case Policy::kMean:
      return true;
    case Policy::kSum:
    case Policy::kMinimum:
    case Policy::kMaximum:
      return !type.is_evidence();
  }
  return false;
}

}  // namespace

std::string_view to_string(Policy policy) { return kPolicyNames.at(static_cast<std::size_t>(policy)); }

std::optional<Policy> policy_from(std::string_view name) {
  const auto it = std::find(kPolicyNames.begin(), kPolicyNames.end(), name);
  if (it == kPolicyNames.end()) return {};
  return static_cast<Policy>(it - kPolicyNames.begin());
}

LayerType LayerType::occupancy(std::string name, Policy policy) {
  return {std::move(name), {"O", "F"}, {"O", "F"}, policy, {}};
}

LayerType LayerType::semantic(std::string name, std::vector<std::string> classes, Policy policy) {
  LayerType type{std::move(name), classes, std::move(classes), policy, {}};
  type.channels.emplace_back("Omega");
  return type;
}

LayerType LayerType::real(std::string name, std::vector<std::string> channels, Policy policy) {
  return {std::move(name), {}, std::move(channels), policy, {}};
}

float LayerType::background(int channel) const {
  if (is_evidence()) return channel == static_cast<int>(hypotheses.size()) ? 1.0f : 0.0f;
  return policy == Policy::kSum ? 0.0f : std::numeric_limits<float>::quiet_NaN();
}

bool LayerType::same_space(const LayerType& other) const {
  return name == other.name && hypotheses == other.hypotheses && channels == other.channels &&
         slab == other.slab;
}

bool LayerType::same_backgrounds(const LayerType& other) const {
  for (int c = 0; c < static_cast<int>(channels.size()); ++c) {
    if (std::bit_cast<std::uint32_t>(background(c)) != std::bit_cast<std::uint32_t>(other.background(c))) {
      return false;
    }
  }
  return true;
}

void LayerType::check() const {
  check_name(name, "layer type");
  for (const auto& h : hypotheses) check_name(h, "hypothesis");
  for (const auto& c : channels) check_name(c, "channel");
  const auto fail = [&](const char* why) {
    throw Error(ErrorCode::kInvalidArgument, "layer type '" + name + "' " + why);
  };
  if (hypotheses.size() == 1 || hypotheses.size() > 15) fail("must have no hypotheses, or 2 to 15");
  if (channels.empty() || channels.size() > 16) fail("must have 1 to 16 channels");
  if (is_evidence() && channels.size() != hypotheses.size() && !stores_omega()) {
    fail("must have a channel for each hypothesis, and at most one more for Omega");
  }
  if (!fits(policy, *this)) fail("has a resampling policy that does not fit its channels");
  constexpr std::int64_t kMaxHeight_um = 1'000'000'000'000;
  if (slab && (slab->z_min_um >= slab->z_max_um || slab->z_min_um < -kMaxHeight_um ||
               slab->z_max_um > kMaxHeight_um)) {
    fail("has an empty height interval, or one beyond 1e6 m");
  }
}

TypeTable::TypeTable(std::vector<LayerType> types) : types_(std::move(types)) {
  if (types_.size() > kMaxTypes) throw Error(ErrorCode::kLimit, "a map has at most 4096 layer types");
  std::sort(types_.begin(), types_.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  for (std::size_t i = 0; i < types_.size(); ++i) {
    types_[i].check();
    if (i > 0 && types_[i].name == types_[i - 1].name) {
      throw Error(ErrorCode::kInvalidArgument, "two layer types are named '" + types_[i].name + "'");
    }
  }
}

std::optional<TypeId> TypeTable::find(std::string_view name) const {
  const auto it = std::lower_bound(types_.begin(), types_.end(), name,
                                   [](const LayerType& t, std::string_view n) { return t.name < n; });
  if (it == types_.end() || it->name != name) return {};
  return static_cast<TypeId>(it - types_.begin());
}

std::vector<TypeId> matching_ids(const TypeTable& from, const TypeTable& to) {
  std::vector<TypeId> ids;
  ids.reserve(from.size());
  for (const LayerType& type : from) {
    const auto id = to.find(type.name);
    if (!id) throw Error(ErrorCode::kIncompatible, "layer type '" + type.name + "' is missing");
    if (!to[*id].same_meaning(type)) {
      throw Error(ErrorCode::kIncompatible, "layer type '" + type.name + "' stands for another space");
    }
    ids.push_back(*id);
  }
  return ids;
}

}  // namespace apgm

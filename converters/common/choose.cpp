#include "converters/common/choose.hpp"

#include <algorithm>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/core/summary.hpp"
#include "apgm/core/working_memory.hpp"

namespace apgm::converters {
namespace {

std::string names_of(const TypeTable& types, std::span<const TypeId> ids) {
  std::string names;
  for (std::size_t i = 0; i < ids.size() && i < 8; ++i) names += (i > 0 ? ", " : "") + types[ids[i]].name;
  return ids.size() > 8 ? names + ", ..." : names;
}

}  // namespace

std::optional<TypeId> choose_occupancy(const PatchSource& source, const std::string& name) {
  const TypeTable& types = source.header().types;
  std::vector<TypeId> all, flat;
  for (std::size_t i = 0; i < types.size(); ++i) {
    const auto id = static_cast<TypeId>(i);
    if (!types[id].is_occupancy()) continue;
    all.push_back(id);
    if (!types[id].slab) flat.push_back(id);
  }
  const auto named = types.find(name.empty() ? "occupancy" : name);
  if (named && types[*named].is_occupancy()) return named;
  if (!name.empty()) {
    throw Error(ErrorCode::kInvalidArgument, named ? "layer '" + name + "' is not an occupancy layer"
                                                   : "the map has no layer '" + name + "'")
        .hint(all.empty() ? "it has no occupancy layers" : "its occupancy layers: " + names_of(types, all));
  }
  if (flat.size() == 1) return flat[0];
  if (all.size() == 1) return all[0];
  if (all.empty()) return {};
  throw Error(ErrorCode::kInvalidArgument, "the map has more than one occupancy layer")
      .hint("choose one with --layer: " + names_of(types, all));
}

int finest_step(const Summary& summary, std::span<const TypeId> chosen) {
  constexpr int kUsualStep = 7;
  std::optional<int> finest;
  for (const TypeId type : chosen) finest = std::max(finest, apgm::finest_step(summary.types[type]));
  return finest.value_or(kUsualStep);
}

std::uint64_t reading_bytes(const PatchSource& source, std::span<const TypeId> chosen, int step) {
  const Summary summary = source.summary();
  std::uint64_t native = 0, fitted = 0;
  for (const TypeId type : chosen) {
    const std::uint64_t cell = source.header().types[type].channels.size() * sizeof(float);
    for (int s = kMaxStep; s >= 0; --s) {
      if (summary.types[type].layers_at[static_cast<std::size_t>(s)] == 0) continue;
      native = std::max(native, cell << (2 * s));
      if (s != step) fitted = std::max(fitted, cell << (2 * std::max(s, step)));
    }
  }
  constexpr std::uint64_t kCodec = 3;  // copies of the layer that decoding takes
  return (1 + kCodec) * native + 2 * fitted + working_bytes(source, native);
}

void report_left_out(const PatchSource& source, std::span<const TypeId> chosen, const Findings& findings) {
  if (!findings) return;
  const Summary summary = source.summary();
  for (std::size_t i = 0; i < summary.types.size(); ++i) {
    const auto type = static_cast<TypeId>(i);
    if (summary.types[i].layers == 0 || std::ranges::find(chosen, type) != chosen.end()) continue;
    findings({Finding::Kind::kLoss, "layer '" + source.header().types[type].name + "' is left out: " +
                                        std::to_string(summary.types[i].layers) + " patches"});
  }
}

void check_cancelled(const RunOptions& run) {
  if (run.cancel != nullptr && run.cancel->load()) throw Error(ErrorCode::kCancelled, "stopped on request");
}

}  // namespace apgm::converters

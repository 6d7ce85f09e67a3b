#pragma once

#include <optional>
#include <span>
#include <string>

#include "apgm/core/source.hpp"
#include "apgm/ops/run.hpp"

namespace apgm::converters {

/// The occupancy layer to export: the one named, else `occupancy`, else the only one without a height.
/// nullopt if no name is asked for and the map has no occupancy layer at all.
/// @throws Error{kInvalidArgument} if the name does not exist or is no occupancy, or there is more than one
/// to
///         choose from
std::optional<TypeId> choose_occupancy(const PatchSource& source, const std::string& name);

/// Finest step of the chosen types' layers; 7 for a map without any.
int finest_step(const Summary& summary, std::span<const TypeId> chosen);

/// Most memory it takes to load layers of the chosen types and to bring them to `step`, one at a time.
std::uint64_t reading_bytes(const PatchSource& source, std::span<const TypeId> chosen, int step);

/// A kLoss finding for each type with layers that is not among the chosen.
void report_left_out(const PatchSource& source, std::span<const TypeId> chosen, const Findings& findings);

/// @throws Error{kCancelled} if the caller asked to stop
void check_cancelled(const RunOptions& run);

}  // namespace apgm::converters

#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "apgm/core/error.hpp"

namespace apgm::converters {

/// What the codes of a class raster mean.
struct Legend {
  /// In place of a class: such a pixel is known to be nothing known.
  static constexpr int kUnknown = -1;

  std::vector<std::string> classes;   ///< 2 to 15 hypotheses, by their least code
  std::map<std::int64_t, int> codes;  ///< code -> number of a class, or kUnknown
};

/// Reads a legend: YAML (.yaml, .yml: `code: name` pairs) or CSV (`code,name` lines; `#` starts a comment;
/// a first line that starts with `code` is a heading). Several codes may share a name; `Omega` means unknown.
/// @throws Error{kUnreadable}, {kForeign} on another extension, {kDamaged} that names the line or the code,
///         {kLimit} on more than 1 MiB or 15 classes
Legend read_legend(const std::string& path);

/// The legend of a raster's own names of values. What a hypothesis cannot be called becomes '_', each a
/// kNote finding. @throws Error as read_legend
Legend legend_from(const std::map<std::int64_t, std::string>& names, const Findings& findings);

}  // namespace apgm::converters

#pragma once

#include <map>
#include <span>
#include <string>

#include "apgm/core/source.hpp"

namespace apgm::ops {

/// A number as it stands in JSON: the shortest digits that give the same double.
std::string json_number(double value);
/// Text as it stands in JSON, in quotes.
std::string json_text(const std::string& text);
std::string json_list(std::span<const std::string> items);
/// One line, keys sorted; values are JSON.
std::string json_object(const std::map<std::string, std::string>& members);

/// The content id of a source, or "unknown" where it has none.
std::string input_id(const PatchSource& source);

}  // namespace apgm::ops

#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "apgm/format/reader.hpp"

namespace apgm::test {

/// All that a file holds, down to the cells, as docs/conformance.md describes it.
/// @throws Error as Reader
nlohmann::json dump(const Reader& reader);

/// `dump`, or how the file is refused: {"refused": "damaged"}.
nlohmann::json result_of(const std::string& path);

}  // namespace apgm::test

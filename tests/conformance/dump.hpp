#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "apgm/format/reader.hpp"

namespace apgm::test {

/// All that a file holds, down to the cells, as docs/conformance.md describes it.
/// @throws Error as Reader
nlohmann::json dump(const Reader& reader);

/// `dump` of the last commit, `commits`, each read to its cells, and `uncommitted_bytes`.
/// @throws Error as Reader
nlohmann::json dump_archive(const std::string& path);

/// The map that the stream in a file makes, the ends of its messages, and what was counted.
nlohmann::json dump_stream(const std::string& path);

/// How the archive is refused, or `dump_archive`.
nlohmann::json result_of_archive(const std::string& path);

/// `dump`, or how the file is refused: {"refused": "damaged"}.
nlohmann::json result_of(const std::string& path);

}  // namespace apgm::test

#pragma once

#include <filesystem>
#include <string_view>

#include "fuzz.hpp"

namespace apgm::fuzz {

/// Writes a seed, and its directory.
void save_seed(const std::filesystem::path& path, std::string_view bytes);

/// Archives of one to three commits, with tags and messages.
void save_archives(const std::filesystem::path& out);
/// Streams of a whole map and of changes, in whole blocks and in parts.
void save_streams(const std::filesystem::path& out);

}  // namespace apgm::fuzz

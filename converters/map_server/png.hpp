#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "apgm/format/output_file.hpp"

namespace apgm::converters {

/// Writes a PNG of 8 bits a channel: grey, or grey and alpha.
/// @param row  fills a row of width * channels bytes; called from the top
void write_png(OutputFile& file, std::int64_t width, std::int64_t height, bool alpha,
               const std::function<void(std::int64_t y, std::span<std::uint8_t> row)>& row);

}  // namespace apgm::converters

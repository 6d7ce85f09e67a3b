#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace apgm::converters {

/// Positions in scan_formats().
enum class Format : std::uint8_t { kCarmen, kCloudList, kCsv, kGraph, kKitti, kPcd };

inline bool is_cloud(Format format) {
  return format == Format::kCsv || format == Format::kKitti || format == Format::kPcd;
}

/// Bytes of a head that format_of looks at.
inline constexpr std::size_t kHeadBytes = 4096;

/// By the first bytes (unpacked), else by the extension. @throws Error{kForeign}
Format format_of(const std::string& path, std::string_view head);
/// A path without ".bz2", which says nothing of what is packed.
std::string unpacked_name(std::string path);
/// A file of a directory that holds a cloud, by its extension.
bool is_cloud_name(const std::string& path);
/// @throws Error{kInvalidArgument}
Format format_named(const std::string& name);

}  // namespace apgm::converters

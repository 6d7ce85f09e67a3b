#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace apgm::tools {

using Json = nlohmann::json;

/// JSON text with sorted keys, two spaces a level and no line end. Numbers are the shortest text that reads
/// back as the same value; numbers that JSON cannot hold become null, bytes that are not UTF-8 U+FFFD.
std::string to_text(const Json& value);
/// As to_text, on one line.
std::string to_line(const Json& value);

/// Finds a value by a dotted path: keys of objects; elements of arrays by position or by their "name".
/// Keys and names may hold dots themselves.
/// @param hint  where nothing is found, receives what exists where the path leaves the document
/// @return      nullptr if the path does not exist
const Json* find_path(const Json& document, std::string_view path, std::string& hint);

/// Text of a stranger, as it may go to a terminal: control characters, and all bytes above 0x7f where it is
/// not UTF-8, as \xNN.
std::string visible_text(std::string_view text);
/// "1.2 MiB"
std::string size_text(std::uint64_t bytes);
/// "12 345 678"
std::string count_text(std::uint64_t n);
/// Shortest text that reads back as `value`.
std::string number_text(double value);
/// "1 patch", "2 patches"
std::string plural(std::uint64_t n, const std::string& one, const std::string& many);
/// "a, b, c"
std::string join(const std::vector<std::string>& words, const std::string& separator = ", ");

/// A table for people: columns as wide as their widest cell, left or right aligned.
class TextTable {
 public:
  /// A heading that starts with '>' makes a right-aligned column.
  explicit TextTable(const std::vector<std::string>& headings);
  void add(std::vector<std::string> row);
  std::string text() const;

 private:
  std::vector<bool> right_;
  std::vector<std::vector<std::string>> rows_;
};

/// Columns a text takes on a terminal: code points of UTF-8.
std::size_t display_width(std::string_view text);

}  // namespace apgm::tools

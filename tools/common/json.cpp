#include "tools/common/json.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "apgm/core/text.hpp"

namespace apgm::tools {
namespace {

std::string quoted(const std::string& text) {
  return Json(text).dump(-1, ' ', false, Json::error_handler_t::replace);
}

void write(const Json& value, int indent, int depth, std::string& out) {
  const auto newline = [&](int levels) {
    if (indent >= 0) out.append("\n").append(static_cast<std::size_t>(indent * levels), ' ');
  };
  const auto list = [&](char open, char close, auto&& write_item) {
    out += open;
    bool first = true;
    for (auto it = value.begin(); it != value.end(); ++it) {
      if (!first) out += ',';
      if (!first && indent < 0) out += ' ';
      first = false;
      newline(depth + 1);
      write_item(it);
      write(*it, indent, depth + 1, out);
    }
    if (!value.empty()) newline(depth);
    out += close;
  };
  switch (value.type()) {
    case Json::value_t::object:
      list('{', '}', [&](const auto& it) { out += quoted(it.key()) + ": "; });
      break;
    case Json::value_t::array:
      list('[', ']', [](const auto&) {});
      break;
    case Json::value_t::number_float:
      out += std::isfinite(value.get<double>()) ? number_text(value.get<double>()) : "null";
      break;
    case Json::value_t::string:
      out += quoted(value.get_ref<const std::string&>());
      break;
    default:
      out += value.dump();
  }
}

std::vector<std::string> keys_of(const Json& value) {
  std::vector<std::string> keys;
  if (value.is_object()) {
    for (const auto& [key, unused] : value.items()) keys.push_back(key);
  }
  if (value.is_array()) {
    for (std::size_t i = 0; i < value.size(); ++i) {
      const bool named = value[i].is_object() && value[i].contains("name") && value[i]["name"].is_string();
      keys.push_back(named ? value[i]["name"].get<std::string>() : std::to_string(i));
    }
  }
  return keys;
}

/// The element of `value` that `key` names, nullptr if none.
const Json* child(const Json& value, const std::string& key) {
  if (value.is_object()) {
    const auto it = value.find(key);
    return it == value.end() ? nullptr : &*it;
  }
  if (!value.is_array()) return nullptr;
  std::size_t position = 0;
  const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), position);
  if (error == std::errc() && end == key.data() + key.size()) {
    return position < value.size() ? &value[position] : nullptr;
  }
  for (const Json& element : value) {
    if (element.is_object() && element.value("name", Json()) == Json(key)) return &element;
  }
  return nullptr;
}

struct Search {
  std::size_t reached = 0;  // characters of the path that led somewhere
  const Json* last = nullptr;
};

const Json* descend(const Json& value, std::string_view path, std::size_t from, Search& search) {
  if (search.last == nullptr || from > search.reached) search = {from, &value};
  for (std::size_t end = path.find('.', from);; end = path.find('.', end + 1)) {
    const bool whole = end == std::string_view::npos;
    const Json* next = child(value, std::string(path.substr(from, whole ? end : end - from)));
    if (next != nullptr) {
      const Json* found = whole ? next : descend(*next, path, end + 1, search);
      if (found != nullptr) return found;
    }
    if (whole) return nullptr;
  }
}

}  // namespace

std::string visible_text(std::string_view text) {
  const bool utf8 = is_utf8(text);
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const auto before = i == 0 ? 0 : static_cast<unsigned char>(text[i - 1]);
    // U+0080 to U+009F are control characters too, some of which terminals obey; C2 alone starts them.
    const auto next = i + 1 == text.size() ? 0 : static_cast<unsigned char>(text[i + 1]);
    const bool is_c1 = (byte == 0xc2 && next < 0xa0) || (before == 0xc2 && byte < 0xa0);
    if (byte < 0x20 || byte == 0x7f || (byte >= 0x80 && (!utf8 || is_c1))) {
      out += fmt::format("\\x{:02x}", byte);
    } else {
      out += text[i];
    }
  }
  return out;
}

std::string to_text(const Json& value) {
  std::string out;
  write(value, 2, 0, out);
  return out;
}

std::string to_line(const Json& value) {
  std::string out;
  write(value, -1, 0, out);
  return out;
}

const Json* find_path(const Json& document, std::string_view path, std::string& hint) {
  Search search;
  if (const Json* found = descend(document, path, 0, search)) return found;
  const std::string where(path.substr(0, search.reached == 0 ? 0 : search.reached - 1));
  const std::vector<std::string> keys = keys_of(*search.last);
  hint = where.empty() ? "" : "'" + where + "' ";
  hint += keys.empty() ? "holds no keys" : (where.empty() ? "keys: " : "holds: ") + join(keys);
  return nullptr;
}

std::string size_text(std::uint64_t bytes) {
  constexpr std::array<const char*, 5> kUnits{"KiB", "MiB", "GiB", "TiB", "PiB"};
  if (bytes < 1024) return fmt::format("{} B", bytes);
  double value = static_cast<double>(bytes) / 1024;
  std::size_t unit = 0;
  while (value >= 1023.95 && unit + 1 < kUnits.size()) {
    value /= 1024;
    ++unit;
  }
  return fmt::format("{:.1f} {}", value, kUnits[unit]);
}

std::string count_text(std::uint64_t n) {
  const std::string digits = std::to_string(n);
  std::string out;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) out += ' ';
    out += digits[i];
  }
  return out;
}

std::string number_text(double value) {
  std::array<char, 32> buffer;
  const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return error == std::errc() ? std::string(buffer.data(), end) : std::string();
}

std::string plural(std::uint64_t n, const std::string& one, const std::string& many) {
  return count_text(n) + " " + (n == 1 ? one : many);
}

std::string join(const std::vector<std::string>& words, const std::string& separator) {
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? "" : separator) + word;
  return out;
}

TextTable::TextTable(const std::vector<std::string>& headings) {
  std::vector<std::string> row;
  for (const std::string& heading : headings) {
    right_.push_back(heading.starts_with('>'));
    row.push_back(right_.back() ? heading.substr(1) : heading);
  }
  rows_.push_back(std::move(row));
}

void TextTable::add(std::vector<std::string> row) {
  row.resize(right_.size());
  rows_.push_back(std::move(row));
}

std::string TextTable::text() const {
  std::vector<std::size_t> widths(right_.size());
  for (const auto& row : rows_) {
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], display_width(row[i]));
  }
  std::string out;
  for (const auto& row : rows_) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string space(widths[i] - display_width(row[i]), ' ');
      line += (i == 0 ? "" : "  ") + (right_[i] ? space + row[i] : row[i] + space);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    out += line + "\n";
  }
  return out;
}

std::size_t display_width(std::string_view text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0u) != 0x80u; }));
}

}  // namespace apgm::tools

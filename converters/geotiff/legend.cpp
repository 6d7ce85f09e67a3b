#include "converters/geotiff/legend.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <optional>

#include "apgm/core/layer_type.hpp"
#include "converters/common/file.hpp"
#include "converters/common/settings.hpp"

namespace apgm::converters {
namespace {

constexpr std::string_view kUnknownName = "Omega";
constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 20;

using Names = std::map<std::int64_t, std::string>;

[[noreturn]] void fail(const std::string& why) {
  throw Error(ErrorCode::kDamaged, "legend: " + why)
      .hint("a legend is lines 'code,name' in a .csv, or pairs 'code: name' in a .yaml");
}

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::optional<std::int64_t> code_of(std::string_view text) {
  std::int64_t code = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), code);
  if (error != std::errc() || end != text.data() + text.size()) return {};
  return code;
}

void add(Names& names, std::string_view code, std::string_view name, const std::string& where) {
  const auto number = code_of(code);
  if (!number) fail(where + ": '" + printable(code) + "' is no code");
  if (name.empty()) fail(where + " has no name");
  if (!names.emplace(*number, name).second) fail("code " + std::to_string(*number) + " stands there twice");
}

Names names_from_csv(std::string_view text) {
  Names names;
  for (int line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view row = trimmed(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (row.empty() || row[0] == '#' || (names.empty() && row.starts_with("code"))) continue;
    const std::size_t comma = row.find(',');
    if (comma == std::string_view::npos || row.find(',', comma + 1) != std::string_view::npos) {
      fail("line " + std::to_string(line) + " is not 'code,name'");
    }
    add(names, trimmed(row.substr(0, comma)), trimmed(row.substr(comma + 1)), "line " + std::to_string(line));
  }
  return names;
}

Names names_from_yaml(const std::string& text) {
  Names names;
  try {
    const YAML::Node root = YAML::Load(text);
    if (!root.IsMap()) fail("its YAML is no list of 'code: name'");
    for (const auto& pair : root) {
      if (!pair.first.IsScalar() || !pair.second.IsScalar()) fail("its YAML is no list of 'code: name'");
      add(names, pair.first.Scalar(), pair.second.Scalar(), "code '" + printable(pair.first.Scalar()) + "'");
    }
  } catch (const YAML::Exception& error) {
    fail("line " + std::to_string(error.mark.line + 1) + ": " + error.msg);
  }
  return names;
}

Legend legend_of(const Names& names) {
  Legend legend;
  for (const auto& [code, name] : names) {
    if (name == kUnknownName) {
      legend.codes[code] = Legend::kUnknown;
      continue;
    }
    const auto it = std::ranges::find(legend.classes, name);
    legend.codes[code] = static_cast<int>(it - legend.classes.begin());
    if (it == legend.classes.end()) legend.classes.push_back(name);
    if (legend.classes.size() > 15) {
      throw Error(ErrorCode::kLimit, "legend: more than 15 classes")
          .hint("give several codes one name in a legend of your own: --set legend=FILE");
    }
  }
  if (legend.classes.size() < 2) fail("it names fewer than two classes");
  try {
    LayerType::semantic("legend", legend.classes).check();
  } catch (const Error& error) {
    throw Error(ErrorCode::kDamaged, "legend: " + error.message()).hint(error.hint());
  }
  return legend;
}

std::string usable_name(const std::string& name) {
  std::string usable;
  for (const char c : name.substr(0, 64)) {
    const bool word = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
    usable += word || (!usable.empty() && (c == '.' || c == '+' || c == '-')) ? c : '_';
  }
  return usable;
}

}  // namespace

Legend read_legend(const std::string& path) {
  const std::string extension = extension_of(path);
  const bool yaml = extension == ".yaml" || extension == ".yml";
  if (!yaml && extension != ".csv") {
    throw Error(ErrorCode::kForeign, "legend '" + path + "' is neither .csv nor .yaml").at(path);
  }
  const std::string text = read_file(path, kMostBytes);
  return naming(path, [&] { return legend_of(yaml ? names_from_yaml(text) : names_from_csv(text)); });
}

Legend legend_from(const Names& names, const Findings& findings) {
  Names usable;
  for (const auto& [code, name] : names) {
    usable[code] = usable_name(name);
    if (usable[code] != name && findings) {
      findings({Finding::Kind::kNote, "class '" + printable(name) + "' is called '" + usable[code] + "'"});
    }
  }
  return legend_of(usable);
}

}  // namespace apgm::converters

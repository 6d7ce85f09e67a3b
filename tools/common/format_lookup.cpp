#include "tools/common/format_lookup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <vector>

#include "apgm/core/error.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/input_head.hpp"
#include "tools/common/parse.hpp"
#include "tools/common/suggest.hpp"

namespace apgm::tools {

using converters::Converter;
using converters::SettingSpec;

namespace {

std::vector<std::string> format_names(bool reading) {
  std::vector<std::string> names{kApgm};
  for (const Converter* c : converters::all()) {
    if (reading ? c->can_read() : c->can_write()) names.emplace_back(c->name());
  }
  return names;
}

bool is_text(const std::string& head) {
  return !head.empty() && std::none_of(head.begin(), head.end(), [](unsigned char c) {
    return (c < 0x20 && c != '\n' && c != '\r' && c != '\t') || c == 0x7f;
  });
}

/// Text that is called YAML gets a message about its YAML.
const Converter* yaml_by_name(const std::string& path, const std::string& head) {
  const Converter* converter = converters::find("map_server");
  return converter != nullptr && converters::for_extension(path) == converter && is_text(head) ? converter
                                                                                               : nullptr;
}

[[noreturn]] void fail_unknown(const std::string& path, const std::string& head) {
  const bool png = head.starts_with("\x89PNG"), pgm = head.starts_with("P2") || head.starts_with("P5");
  if (head.empty()) {
    throw Error(ErrorCode::kForeign, fmt::format("'{}' is empty", path))
        .hint("nothing was written to it, or all of it was lost")
        .at(path);
  }
  std::string hint = "apgm-convert reads: " + join(format_names(true));
  if (png || pgm) hint += "; a picture is read by the YAML of its map";
  Error error(ErrorCode::kForeign, fmt::format("'{}' is of no format apgm-convert reads{}", path,
                                               png   ? ": it is a PNG image"
                                               : pgm ? ": it is a PGM image"
                                                     : ""));
  throw error.hint(hint).at(path);
}

}  // namespace

const Converter* format_named(const std::string& option, const std::string& name, bool reading) {
  const std::string known = parse_choice(option, name, format_names(reading));
  return known == kApgm ? nullptr : converters::find(known);
}

const Converter* format_of_output(const std::string& path) {
  if (path == "-" || path.ends_with(".apgm")) return nullptr;
  if (const Converter* converter = converters::for_extension(path)) return converter;
  throw usage_error(fmt::format("the extension of '{}' names no format", path),
                    "pass --to with one of: " + join(format_names(false)));
}

InputFormat format_of_input(const std::string& path) {
  const std::string head = head_of(path);
  if (is_apgm(head)) return {nullptr, is_stream_input(path, head)};
  const Converter* converter = converters::sniff(path, std::as_bytes(std::span(head)));
  if (path == "-") {
    if (converter == nullptr) return {};
    throw Error(ErrorCode::kUnsupported, fmt::format("{} is not read from standard input", converter->name()))
        .hint("pass the file by its name");
  }
  if (converter == nullptr) converter = yaml_by_name(path, head);
  if (converter == nullptr && is_stream_input(path, head)) return {nullptr, true};
  if (converter == nullptr && !path.ends_with(".apgm")) fail_unknown(path, head);
  return {converter};
}

std::string format_name(const Converter* converter) {
  return converter == nullptr ? kApgm : std::string(converter->name());
}

Json formats_json() {
  Json formats = Json::array();
  formats.push_back({{"name", kApgm},
                     {"description", "adaptive patched grid maps; as streams too"},
                     {"extensions", {".apgm", kStreamExtension}},
                     {"reads", true},
                     {"writes", true},
                     {"settings", Json::array()},
                     {"losses", Json::array()}});
  for (const Converter* c : converters::all()) {
    Json settings = Json::array();
    for (const SettingSpec& s : c->settings()) {
      settings.push_back({{"key", s.key},
                          {"meaning", s.meaning},
                          {"default", s.default_value.empty() ? Json() : Json(s.default_value)},
                          {"for_reading", s.for_reading},
                          {"for_writing", s.for_writing}});
    }
    formats.push_back({{"name", c->name()},
                       {"description", c->description()},
                       {"extensions", c->extensions()},
                       {"reads", c->can_read()},
                       {"writes", c->can_write()},
                       {"settings", settings},
                       {"losses", c->losses()}});
  }
  return formats;
}

std::string formats_text(const Json& formats) {
  std::string text;
  for (const Json& format : formats) {
    const bool reads = format["reads"], writes = format["writes"];
    text += fmt::format("{}{}  {} ({}), {}\n", text.empty() ? "" : "\n", format["name"].get<std::string>(),
                        format["description"].get<std::string>(),
                        join(format["extensions"].get<std::vector<std::string>>(), " "),
                        reads ? (writes ? "reads and writes" : "reads") : "writes");
    TextTable settings({"  setting", "for", "default", "meaning"});
    for (const Json& s : format["settings"]) {
      const bool in = s["for_reading"], out = s["for_writing"];
      settings.add({"  " + s["key"].get<std::string>(), in ? (out ? "both" : "reading") : "writing",
                    s["default"].is_null() ? "" : s["default"].get<std::string>(), s["meaning"]});
    }
    if (!format["settings"].empty()) text += settings.text();
    for (const Json& loss : format["losses"]) text += "  lost: " + loss.get<std::string>() + "\n";
  }
  return text;
}

}  // namespace apgm::tools

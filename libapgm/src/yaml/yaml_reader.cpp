#include "yaml/yaml_reader.hpp"

#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>
#include <set>
#include <sstream>

#include "apgm/core/text.hpp"

namespace apgm::yaml {
namespace {

constexpr std::size_t kMaxTextBytes = 1 << 20;
constexpr int kMaxDepth = 16;
constexpr std::size_t kMaxShown = 60;
constexpr std::size_t kMaxNameBytes = 255;

/// `text` for a message: cut, without control characters.
std::string printable(std::string_view text) {
  std::string shown(text.substr(0, kMaxShown));
  // Not inside a UTF-8 character.
  while (!is_utf8(shown)) shown.pop_back();
  std::ranges::replace_if(
      shown, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, '?');
  return shown.size() < text.size() ? shown + "..." : shown;
}

[[noreturn]] void fail(const std::string& name, const YAML::Mark& mark, const std::string& why,
                       const std::string& hint) {
  const std::string line = mark.is_null() ? "" : " line " + std::to_string(mark.line + 1);
  throw Error(ErrorCode::kInvalidArgument, "'" + name + "'" + line + ": " + why).hint(hint).at(name);
}

/// Refuses, before a tree is built, what a tree could not tell or should not hold.
class StructureCheck : public YAML::EventHandler {
 public:
  explicit StructureCheck(const std::string& name) : name_(name) {}

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (++documents_ > 1) fail(name_, mark, "a second document begins", "remove the line '---'");
  }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override { check(mark, "", anchor); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { refuse_anchor(mark); }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string&) override {
    check(mark, tag, anchor);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    check(mark, tag, anchor);
    enter(mark);
  }
  void OnSequenceEnd() override { --depth_; }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    check(mark, tag, anchor);
    enter(mark);
  }
  void OnMapEnd() override { --depth_; }

 private:
  [[noreturn]] void refuse_anchor(const YAML::Mark& mark) const {
    fail(name_, mark, "anchors and aliases are not read here", "write the value out where it is used");
  }
  void check(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor) const {
    if (anchor != 0) refuse_anchor(mark);
    // yaml-cpp gives plain values "?" and quoted ones "!".
    if (!tag.empty() && tag != "?" && tag != "!") {
      fail(name_, mark, "tags such as '" + printable(tag) + "' are not read here", "remove it");
    }
  }
  void enter(const YAML::Mark& mark) {
    if (++depth_ > kMaxDepth) fail(name_, mark, "lists and maps are nested too deep", "");
  }

  const std::string& name_;
  int depth_ = 0;
  int documents_ = 0;
};

/// Least number of characters to insert, delete or replace.
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t k = 0; k < b.size(); ++k) {
      const std::size_t replaced = diagonal + (a[i] != b[k]);
      diagonal = row[k + 1];
      row[k + 1] = std::min({replaced, row[k] + 1, row[k + 1] + 1});
    }
  }
  return row.back();
}

/// A finite number in any form that YAML and JSON share; nullopt otherwise. The same in every locale.
std::optional<double> parse_number(std::string_view text) {
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  double value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return {};
  return value;
}

bool is_quoted(const YAML::Node& node) { return node.Tag() == "!"; }

}  // namespace

void YamlValue::refuse(const std::string& why, const std::string& hint) const {
  fail(*name_, node_.Mark(), what_ + " " + why, hint);
}

double YamlValue::number(const std::string& hint) const {
  if (!node_.IsScalar() || is_quoted(node_)) refuse("is not a number", hint);
  const auto value = parse_number(node_.Scalar());
  if (!value) refuse("is '" + printable(node_.Scalar()) + "', which is not a finite number", hint);
  return *value;
}

std::string YamlValue::text() const {
  if (!node_.IsScalar() || node_.Scalar().empty()) refuse("is not a text", "");
  if (node_.Scalar().size() > kMaxNameBytes) refuse("is longer than 255 bytes", "");
  if (!is_plain_text(node_.Scalar())) refuse("holds control characters", "");
  return node_.Scalar();
}

std::vector<YamlValue> YamlValue::list() const {
  if (!node_.IsSequence()) refuse("is not a list", "a list is written [a, b], or one '- ' a line");
  std::vector<YamlValue> values;
  for (const YAML::Node& element : node_) {
    values.emplace_back(element, *name_, "entry " + std::to_string(values.size() + 1) + " of " + what_);
  }
  return values;
}

YamlMap::YamlMap(const YamlValue& value, std::vector<std::string_view> keys)
    : YamlValue(value), keys_(std::move(keys)) {
  if (!node_.IsMap()) refuse("holds no keys", hint_for(""));
  check_keys();
}

void YamlMap::check_keys() const {
  std::set<std::string> seen;  // YAML lets the last of two equal keys win without a word
  for (const auto& pair : node_) {
    const std::string key = pair.first.IsScalar() ? pair.first.Scalar() : "";
    if (std::ranges::find(keys_, key) == keys_.end()) {
      fail(*name_, pair.first.Mark(), key_text(printable(key)) + " is unknown", hint_for(key));
    }
    if (!seen.insert(key).second) {
      fail(*name_, pair.first.Mark(), key_text(key) + " is given twice", "keep one");
    }
    if (pair.second.IsNull()) fail(*name_, pair.first.Mark(), key_text(key) + " has no value", "");
  }
}

std::string YamlMap::key_text(std::string_view key) const {
  std::string_view owner = what_;
  if (owner.starts_with("the ")) return "key '" + std::string(key) + "'";
  if (owner.starts_with("key ")) owner.remove_prefix(4);
  return "key '" + std::string(key) + "' of " + std::string(owner);
}

std::string YamlMap::hint_for(std::string_view unknown) const {
  std::string hint;
  const auto nearest =
      std::ranges::min_element(keys_, {}, [&](std::string_view k) { return distance(k, unknown); });
  if (unknown.size() <= kMaxShown && distance(*nearest, unknown) <= 1 + nearest->size() / 3) {
    hint = "did you mean '" + std::string(*nearest) + "'? ";
  }
  hint += "known keys: ";
  for (const std::string_view key : keys_) hint += (key == keys_.front() ? "" : ", ") + std::string(key);
  return hint;
}

YAML::Node YamlMap::find(std::string_view key) const {
  for (const auto& pair : node_) {
    if (pair.first.Scalar() == key) return pair.second;
  }
  return YAML::Node(YAML::NodeType::Undefined);
}

YamlValue YamlMap::at(std::string_view key) const {
  const YAML::Node node = find(key);
  if (!node.IsDefined()) refuse("has no key '" + std::string(key) + "'", hint_for(""));
  return {node, *name_, key_text(key)};
}

YamlValue load_yaml(std::string_view text, const std::string& name) {
  if (text.size() > kMaxTextBytes) fail(name, YAML::Mark::null_mark(), "the text is longer than 1 MiB", "");
  if (!is_utf8(text)) fail(name, YAML::Mark::null_mark(), "the text is not UTF-8", "");
  try {
    std::istringstream stream{std::string(text)};
    YAML::Parser parser(stream);
    StructureCheck check(name);
    while (parser.HandleNextDocument(check)) {
    }
    return {YAML::Load(std::string(text)), name, "the text"};
  } catch (const YAML::Exception& error) {
    fail(name, error.mark, "not valid YAML: " + printable(error.msg), "one 'key: value' a line");
  }
}

}  // namespace apgm::yaml

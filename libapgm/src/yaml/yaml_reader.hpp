#pragma once

#include <yaml-cpp/yaml.h>

#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "apgm/core/error.hpp"

namespace apgm::yaml {

/// A value of a YAML text, with what messages need to name it. All members throw Error{kInvalidArgument} with
/// the name of the text and the line.
class YamlValue {
 public:
  /// @param what  the value in messages, such as "key 'sigma_m' of 'nuss'"
  YamlValue(YAML::Node node, const std::string& name, std::string what)
      : node_(std::move(node)), name_(&name), what_(std::move(what)) {}

  /// A finite number, not quoted. `hint` tells what it should be.
  double number(const std::string& hint) const;
  /// A text of one line, not empty, without control characters.
  std::string text() const;
  /// The elements of a list.
  std::vector<YamlValue> list() const;
  bool is_list() const { return node_.IsSequence(); }
  const std::string& what() const { return what_; }

  [[noreturn]] void refuse(const std::string& why, const std::string& hint) const;

 protected:
  YAML::Node node_;
  const std::string* name_;
  std::string what_;
};

/// A map of a YAML text, all of whose keys are known, each given once.
class YamlMap : public YamlValue {
 public:
  /// @param keys  all that are allowed
  YamlMap(const YamlValue& value, std::vector<std::string_view> keys);

  bool has(std::string_view key) const { return find(key).IsDefined(); }
  /// The value of a key that must be there.
  YamlValue at(std::string_view key) const;

 private:
  YAML::Node find(std::string_view key) const;
  void check_keys() const;
  std::string hint_for(std::string_view unknown) const;
  std::string key_text(std::string_view key) const;

  std::vector<std::string_view> keys_;
};

/// The one document of `text`, which is UTF-8 of at most 1 MiB, without anchors, aliases and tags, nested at
/// most 16 deep. @param name  outlives the value
YamlValue load_yaml(std::string_view text, const std::string& name);

}  // namespace apgm::yaml

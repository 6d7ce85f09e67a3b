#pragma once

#include <string>

namespace apgm::ops {

/// A map's name for messages: in quotes, unless it says what the map is ("the base").
inline std::string quoted(const std::string& name) {
  return name.starts_with("the ") ? name : "'" + name + "'";
}

}  // namespace apgm::ops

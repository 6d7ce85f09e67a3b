#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apgm/core/frame.hpp"
#include "tools/common/session.hpp"

namespace CLI {
class App;
}

namespace apgm::tools {

/// --blame: which of the maps that a map was made of observed a point.
class BlameQuestion {
 public:
  void add(CLI::App& app);
  bool asked() const { return text_.has_value(); }
  /// @param inputs  the map, then the maps it may be made of
  /// @throws Error{kInvalidArgument}
  void check(const std::vector<std::string>& inputs);
  /// Prints the answer, and adds the member `blame` to the document.
  /// @return  true if an input is named
  bool answer(Session& session, const std::vector<std::string>& inputs) const;

 private:
  std::optional<std::string> text_;
  Point point_;
};

}  // namespace apgm::tools

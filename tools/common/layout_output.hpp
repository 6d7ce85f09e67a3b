#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apgm/format/output_file.hpp"
#include "tools/common/layout_chart.hpp"
#include "tools/common/layout_table.hpp"

namespace apgm::tools {

/// Where a comparison is written beside the terminal.
struct LayoutFiles {
  std::optional<std::string> csv, plot;
  bool overwrite = false;

  /// Takes the paths. @throws Error{kInvalidArgument|kOutput} for paths that cannot be written, are one file,
  /// or
  ///         are among `inputs`
  void check(const std::optional<std::string>& csv_path, const std::optional<std::string>& plot_path,
             bool may_replace, const std::vector<std::string>& inputs);
};

/// Writes the table as it grows, and the picture at the end; both appear with `finish` or not at all.
class LayoutOutput {
 public:
  /// @throws Error{kOutput}; so do all
  explicit LayoutOutput(const LayoutFiles& files);
  void add(const LayoutsAt& at);
  void finish(const std::string& title);

 private:
  std::unique_ptr<OutputFile> csv_, plot_;
  LayoutChart chart_;
};

/// Means of a drive, one for each stretch of time with one profile.
class DriveMeans {
 public:
  void add(const LayoutsAt& at);
  Json json() const;
  std::string text() const;

 private:
  struct Phase {
    std::string profile;
    LayoutMeans means;
  };
  std::vector<Phase> phases_;
};

}  // namespace apgm::tools

#include "tools/common/layout_output.hpp"

#include <fmt/format.h>

#include "tools/common/exit_code.hpp"
#include "tools/common/options.hpp"

namespace apgm::tools {

void LayoutFiles::check(const std::optional<std::string>& csv_path,
                        const std::optional<std::string>& plot_path, bool may_replace,
                        const std::vector<std::string>& inputs) {
  csv = csv_path;
  plot = plot_path;
  overwrite = may_replace;
  for (const auto& [option, path] : {std::pair{"--csv", csv}, std::pair{"--plot", plot}}) {
    if (!path) continue;
    if (*path == "-") {
      throw usage_error(fmt::format("{} is not written to standard output", option), "name a file");
    }
    check_output_path(*path, overwrite, inputs);
  }
  if (csv && plot && same_file(*csv, *plot)) throw usage_error("--csv and --plot name one file");
}

LayoutOutput::LayoutOutput(const LayoutFiles& files) {
  const OutputOptions options{files.overwrite};
  if (files.csv) csv_ = std::make_unique<OutputFile>(*files.csv, options);
  if (files.plot) plot_ = std::make_unique<OutputFile>(*files.plot, options);
  if (csv_) csv_->write(layouts_csv_heading());
}

void LayoutOutput::add(const LayoutsAt& at) {
  if (csv_) csv_->write(layouts_csv(at));
  if (plot_) chart_.add(at);
}

void LayoutOutput::finish(const std::string& title) {
  if (plot_) plot_->write(chart_.svg(title));
  if (csv_) csv_->flush();
  if (plot_) plot_->flush();
  if (csv_) csv_->commit();
  if (plot_) plot_->commit();
}

void DriveMeans::add(const LayoutsAt& at) {
  if (phases_.empty() || phases_.back().profile != at.profile) phases_.push_back({at.profile, {}});
  phases_.back().means.add(at);
}

Json DriveMeans::json() const {
  Json list = Json::array();
  for (const Phase& phase : phases_) {
    list.push_back({{"profile", phase.profile},
                    {"from_s", phase.means.from_s()},
                    {"to_s", phase.means.to_s()},
                    {"moments", phase.means.moments()},
                    {"layouts", phase.means.json()}});
  }
  return list;
}

std::string DriveMeans::text() const {
  std::string text;
  for (const Phase& phase : phases_) {
    if (!text.empty()) text += "\n";
    text += fmt::format("{}, {:.1f} to {:.1f} s, means of {}\n\n{}", phase.profile, phase.means.from_s(),
                        phase.means.to_s(), plural(phase.means.moments(), "moment", "moments"),
                        phase.means.text());
  }
  return text;
}

}  // namespace apgm::tools

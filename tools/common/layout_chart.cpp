#include "tools/common/layout_chart.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "tools/common/chart.hpp"

namespace apgm::tools {
namespace {

/// Name of a curve for two layouts: "buerkle-A" and "buerkle-B" are "buerkle-A, B".
std::string joined(const std::string& names, const std::string& name) {
  if (name.starts_with("submaps-") && names.starts_with("submaps")) return "submaps, all containers";
  const std::string kind = name.substr(0, name.find('-') + 1);
  return names + ", " + (!kind.empty() && names.starts_with(kind) ? name.substr(kind.size()) : name);
}

}  // namespace

void LayoutChart::add(const LayoutsAt& at) {
  Moment moment{at.time_s, at.profile, {}};
  for (const LayoutRow& row : at.rows) moment.values.push_back(row.footprint.values);
  moments_.push_back(std::move(moment));
  last_ = at.rows;
}

std::string LayoutChart::svg(const std::string& title) const {
  return moments_.size() == 1 ? bars(title) : lines(title);
}

std::string LayoutChart::bars(const std::string& title) const {
  BarChart chart{title, {"values", "allocated"}, {}};
  const bool disk = !last_.empty() && last_.front().disk_bytes.has_value();
  if (disk) chart.kinds.emplace_back("on disk");
  const auto bar = [&](std::uint64_t bytes, std::uint64_t own) {
    std::string label = size_text(bytes);
    if (own > 0) label += fmt::format("  x {:.2f}", static_cast<double>(bytes) / static_cast<double>(own));
    return BarChart::Bar{static_cast<double>(bytes), label};
  };
  for (const LayoutRow& row : last_) {
    const LayoutRow& own = last_.front();
    BarChart::Group group{row.layout, {}};
    group.bars.push_back(bar(row.footprint.value_bytes(), own.footprint.value_bytes()));
    group.bars.push_back(bar(row.footprint.allocated_bytes, own.footprint.allocated_bytes));
    if (disk) group.bars.push_back(bar(row.disk_bytes.value_or(0), own.disk_bytes.value_or(0)));
    chart.groups.push_back(std::move(group));
  }
  return to_svg(chart);
}

std::string LayoutChart::lines(const std::string& title) const {
  LineChart chart{title, "time [s]", "values [MB], logarithmic", {}, {}};
  std::vector<std::vector<std::uint64_t>> drawn;
  for (std::size_t i = 0; i < last_.size(); ++i) {
    std::vector<std::uint64_t> values;
    for (const Moment& moment : moments_) values.push_back(i < moment.values.size() ? moment.values[i] : 0);
    if (const auto same = std::ranges::find(drawn, values); same != drawn.end()) {
      std::string& name = chart.lines[static_cast<std::size_t>(same - drawn.begin())].name;
      name = joined(name, last_[i].layout);
      continue;
    }
    LineChart::Line line{last_[i].layout, {}};
    for (std::size_t k = 0; k < moments_.size(); ++k) {
      line.points.emplace_back(moments_[k].time_s, static_cast<double>(values[k]) * sizeof(float) / 1e6);
    }
    chart.lines.push_back(std::move(line));
    drawn.push_back(std::move(values));
  }
  for (const Moment& moment : moments_) {
    auto& all = chart.stretches;
    if (!all.empty()) all.back().to = moment.time_s;
    if (all.empty() || all.back().name != moment.profile) {
      all.push_back({moment.profile, moment.time_s, moment.time_s});
    }
  }
  return to_svg(chart);
}

}  // namespace apgm::tools

#include "tools/common/layout_chart.hpp"

#include <fmt/format.h>

#include <algorithm>

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
  Moment moment{at.time_s, at.profile, {}, {}};
  for (const LayoutRow& row : at.rows) {
    moment.values_mb.push_back(static_cast<double>(row.footprint.value_bytes()) / 1e6);
    moment.shift_ms.push_back(row.cost && row.shifts > 0 ? row.cost->shift_ns / 1e6 : 0);
  }
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
    if (!row.in_memory && !row.disk_bytes) continue;
    const BarChart::Bar none{-1, ""};
    const Footprint &f = row.footprint, &of_own = own.footprint;
    group.bars.push_back(row.in_memory ? bar(f.value_bytes(), of_own.value_bytes()) : none);
    group.bars.push_back(row.in_memory ? bar(f.allocated_bytes, of_own.allocated_bytes) : none);
    if (disk) group.bars.push_back(row.disk_bytes ? bar(*row.disk_bytes, own.disk_bytes.value_or(0)) : none);
    chart.groups.push_back(std::move(group));
  }
  return to_svg(chart);
}

LineChart LayoutChart::curves(const std::string& title, const std::string& unit,
                              std::vector<double> Moment::*of) const {
  LineChart chart{title, "time [s]", unit, {}, {}};
  std::vector<std::vector<double>> drawn;
  for (std::size_t i = 0; i < last_.size(); ++i) {
    std::vector<double> values;
    for (const Moment& moment : moments_) {
      values.push_back(i < (moment.*of).size() ? (moment.*of)[i] : 0);
    }
    if (std::ranges::all_of(values, [](double v) { return v == 0; })) continue;
    if (const auto same = std::ranges::find(drawn, values); same != drawn.end()) {
      std::string& name = chart.lines[static_cast<std::size_t>(same - drawn.begin())].name;
      name = joined(name, last_[i].layout);
      continue;
    }
    LineChart::Line line{last_[i].layout, {}};
    for (std::size_t k = 0; k < moments_.size(); ++k) line.points.emplace_back(moments_[k].time_s, values[k]);
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
  return chart;
}

std::string LayoutChart::lines(const std::string& title) const {
  std::vector<LineChart> charts{curves(title, "values [MB], logarithmic", &Moment::values_mb)};
  LineChart shifts = curves("mean time of a shift", "shift [ms], logarithmic", &Moment::shift_ms);
  if (!shifts.lines.empty()) charts.push_back(std::move(shifts));
  return to_svg(charts);
}

}  // namespace apgm::tools

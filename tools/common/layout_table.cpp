#include "tools/common/layout_table.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace apgm::tools {
namespace {

constexpr const char* kHeading =
    "time_s,profile,x_m,y_m,layout,values_per_cell,cells,known_cells,fill,values_bytes,allocated_bytes,"
    "disk_bytes,known_source_cells,lost_cells,mean_change,max_change,lost_obstacles,"
    "find_ns,insert_ns,grow_ns,shift_ns,iterate_ns,snapshot_ns,shifts,note\n";

std::string csv_text(const std::string& name) {
  if (name.find_first_of(",\"\n") == std::string::npos) return name;
  std::string text = "\"";
  for (const char c : name) text += c == '"' ? std::string("\"\"") : std::string(1, c);
  return text + "\"";
}

std::string footprint_csv(const LayoutRow& row) {
  if (!row.in_memory) return ",,,,";
  const Footprint& f = row.footprint;
  return fmt::format("{},{},{:.4f},{},{}", f.cells, f.known_cells, f.fill_rate(), f.value_bytes(),
                     f.allocated_bytes);
}

std::string change_csv(const std::optional<BeliefChange>& change) {
  if (!change) return ",,,,";
  return fmt::format("{},{},{:.6f},{:.6f},{}", change->known_cells, change->lost_cells, change->mean(),
                     change->most, change->obstacles);
}

std::string cost_csv(const std::optional<LayoutCost>& cost) {
  if (!cost) return ",,,,,";
  return fmt::format("{:.1f},{:.1f},{:.0f},{:.0f},{:.3f},{:.0f}", cost->find_ns, cost->insert_ns,
                     cost->grow_ns, cost->shift_ns, cost->iterate_ns, cost->snapshot_ns);
}

void add(BeliefChange& sum, const BeliefChange& change) {
  sum.known_cells += change.known_cells;
  sum.lost_cells += change.lost_cells;
  sum.sum += change.sum;
  sum.most = std::max(sum.most, change.most);
  sum.obstacles += change.obstacles;
}

void add(LayoutCost& sum, const LayoutCost& cost) {
  sum.find_ns += cost.find_ns;
  sum.insert_ns += cost.insert_ns;
  sum.grow_ns += cost.grow_ns;
  sum.shift_ns += cost.shift_ns;
  sum.iterate_ns += cost.iterate_ns;
  sum.snapshot_ns += cost.snapshot_ns;
}

double divided(double a, double b) { return b > 0 ? a / b : 0; }

/// 0 says that it does not happen there.
std::string time_text(double ns) {
  if (ns <= 0) return "-";
  if (ns < 1e3) return fmt::format("{:.1f} ns", ns);
  return ns < 1e6 ? fmt::format("{:.1f} us", ns / 1e3) : fmt::format("{:.2f} ms", ns / 1e6);
}

std::string count_of(double mean) { return count_text(static_cast<std::uint64_t>(mean + 0.5)); }
std::string size_of(double mean) { return size_text(static_cast<std::uint64_t>(mean + 0.5)); }

}  // namespace

std::string layouts_csv_heading() { return kHeading; }

std::string layouts_csv(const LayoutsAt& at) {
  std::string text;
  for (const LayoutRow& row : at.rows) {
    text += fmt::format("{:.3f},{},{:.3f},{:.3f},{},{},{},{},{},{},{},{}\n", at.time_s, csv_text(at.profile),
                        at.vehicle.x_m, at.vehicle.y_m, csv_text(row.layout),
                        row.values_per_cell == 0 ? "" : std::to_string(row.values_per_cell),
                        footprint_csv(row), row.disk_bytes ? std::to_string(*row.disk_bytes) : "",
                        change_csv(row.change), cost_csv(row.cost), row.shifts, csv_text(row.note));
  }
  return text;
}

double LayoutMeans::mean_disk(const Sums& s) { return divided(s.disk, static_cast<double>(s.disks)); }

void LayoutMeans::add(const LayoutsAt& at) {
  if (moments_++ == 0) from_s_ = at.time_s;
  to_s_ = at.time_s;
  layouts_.resize(std::max(layouts_.size(), at.rows.size()));
  for (std::size_t i = 0; i < at.rows.size(); ++i) {
    const LayoutRow& row = at.rows[i];
    Sums& sums = layouts_[i];
    sums.layout = row.layout;
    sums.values_per_cell = row.values_per_cell;
    sums.in_memory += row.in_memory;
    sums.shifts += row.shifts;
    if (!row.note.empty()) sums.note = row.note;
    sums.cells += static_cast<double>(row.footprint.cells);
    sums.values += static_cast<double>(row.footprint.values);
    sums.known += static_cast<double>(row.footprint.known_cells);
    sums.allocated += static_cast<double>(row.footprint.allocated_bytes);
    sums.most_values = std::max(sums.most_values, row.footprint.values);
    if (row.disk_bytes) {
      sums.disk += static_cast<double>(*row.disk_bytes);
      ++sums.disks;
    }
    if (row.change) {
      tools::add(sums.change, *row.change);
      ++sums.changes;
    }
    if (row.cost) {
      tools::add(sums.cost, *row.cost);
      ++sums.costs;
    }
  }
}

Json LayoutMeans::size_json(const Sums& s) const {
  const Sums& own = layouts_.front();
  Json json = {{"layout", s.layout}, {"shifts", s.shifts}};
  if (!s.note.empty()) json["note"] = s.note;
  if (s.in_memory > 0) {
    const auto n = static_cast<double>(s.in_memory), own_n = static_cast<double>(own.in_memory);
    json["values_per_cell"] = s.values_per_cell == 0 ? Json() : Json(s.values_per_cell);
    json["cells"] = s.cells / n;
    json["values"] = s.values / n;
    json["most_values"] = s.most_values;
    json["known_cells"] = s.known / n;
    json["fill"] = divided(s.known, s.cells);
    json["values_bytes"] = 4 * s.values / n;
    json["allocated_bytes"] = s.allocated / n;
    json["values_ratio"] = divided(s.values / n, own.values / own_n);
    json["allocated_ratio"] = divided(s.allocated / n, own.allocated / own_n);
  }
  if (s.disks > 0) {
    json["disk_bytes"] = mean_disk(s);
    json["disk_ratio"] = divided(mean_disk(s), mean_disk(own));
  }
  return json;
}

Json LayoutMeans::json() const {
  Json list = Json::array();
  for (const Sums& s : layouts_) {
    Json json = size_json(s);
    if (s.changes > 0) {
      const auto n = static_cast<double>(s.changes);
      json["belief"] = {{"known_cells", static_cast<double>(s.change.known_cells) / n},
                        {"lost_cells", static_cast<double>(s.change.lost_cells) / n},
                        {"mean_change", s.change.mean()},
                        {"max_change", s.change.most},
                        {"lost_obstacles", static_cast<double>(s.change.obstacles) / n}};
    }
    if (s.costs > 0) {
      const auto n = static_cast<double>(s.costs);
      json["cost"] = {{"find_ns", s.cost.find_ns / n},       {"insert_ns", s.cost.insert_ns / n},
                      {"grow_ns", s.cost.grow_ns / n},       {"shift_ns", s.cost.shift_ns / n},
                      {"iterate_ns", s.cost.iterate_ns / n}, {"snapshot_ns", s.cost.snapshot_ns / n}};
    }
    list.push_back(json);
  }
  return list;
}

std::string LayoutMeans::sizes_text() const {
  const Sums& own = layouts_.front();
  const auto ratio = [](double a, double b) { return b > 0 ? fmt::format("{:.2f}", a / b) : "-"; };
  TextTable table({"layout", ">cells", ">fill", ">values", ">x", ">allocated", ">x", ">on disk", ">x"});
  for (const Sums& s : layouts_) {
    std::vector<std::string> line{s.layout, "-", "-", "-", "-", "-", "-", "-", "-"};
    if (s.in_memory > 0) {
      const auto n = static_cast<double>(s.in_memory), own_n = static_cast<double>(own.in_memory);
      line = {s.layout,
              count_of(s.cells / n),
              fmt::format("{:.0f} %", 100 * divided(s.known, s.cells)),
              size_of(4 * s.values / n),
              ratio(s.values / n, own.values / own_n),
              size_of(s.allocated / n),
              ratio(s.allocated / n, own.allocated / own_n),
              "-",
              "-"};
    }
    if (s.disks > 0) {
      line[7] = size_of(mean_disk(s));
      line[8] = ratio(mean_disk(s), mean_disk(own));
    }
    table.add(line);
  }
  return table.text();
}

std::string LayoutMeans::beliefs_text() const {
  TextTable table({"layout", ">cells lost", ">mean change", ">greatest", ">obstacles lost"});
  for (const Sums& s : layouts_) {
    if (s.changes == 0) {
      table.add({s.layout, "-", "-", "-", "-"});
      continue;
    }
    const BeliefChange& c = s.change;
    table.add({s.layout,
               fmt::format("{:.1f} %", 100 * divided(static_cast<double>(c.lost_cells),
                                                     static_cast<double>(c.known_cells))),
               fmt::format("{:.4f}", c.mean()), fmt::format("{:.3f}", c.most),
               count_of(static_cast<double>(c.obstacles) / static_cast<double>(s.changes))});
  }
  return table.text();
}

std::string LayoutMeans::costs_text() const {
  TextTable table({"layout", ">find", ">insert", ">new sub-map", ">shift", ">read a cell", ">snapshot"});
  for (const Sums& s : layouts_) {
    if (s.costs == 0) continue;
    const auto n = static_cast<double>(s.costs);
    table.add({s.layout, time_text(s.cost.find_ns / n), time_text(s.cost.insert_ns / n),
               time_text(s.cost.grow_ns / n), time_text(s.cost.shift_ns / n),
               time_text(s.cost.iterate_ns / n), time_text(s.cost.snapshot_ns / n)});
  }
  return table.text();
}

std::string LayoutMeans::text() const {
  if (moments_ == 0) return {};
  std::string text = sizes_text();
  if (std::ranges::any_of(layouts_, [](const Sums& s) { return s.changes > 0; }))
    text += "\n" + beliefs_text();
  if (std::ranges::any_of(layouts_, [](const Sums& s) { return s.costs > 0; })) text += "\n" + costs_text();
  std::string notes;
  for (const Sums& s : layouts_) {
    if (!s.note.empty()) notes += fmt::format("{}: {}\n", s.layout, s.note);
  }
  return notes.empty() ? text : text + "\n" + notes;
}

}  // namespace apgm::tools

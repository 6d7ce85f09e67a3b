#include "writers.hpp"

#include <algorithm>
#include <filesystem>
#include <sstream>
#include <stdexcept>

#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"
#include "random_map.hpp"

namespace apgm::test {
namespace {

constexpr const char* kOldYaml =
    "image: out.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: "
    "0.196\n";

void write_map(const std::string& path, std::uint64_t seed, int patches_per_side) {
  RandomMapOptions options;
  options.range = {{0, 0}, {patches_per_side - 1, patches_per_side - 1}};
  options.fill = 0.9;
  options.min_step = options.max_step = 6;
  options.types = {LayerType::occupancy()};
  const Map map = random_map(seed, options);
  Writer writer(path, map.header());
  copy(map, map.header().types, writer, true);
  writer.finish();
}

/// A laser that drives along a corridor.
std::string scan_log(int scans) {
  std::ostringstream text;
  for (int i = 0; i < scans; ++i) {
    text << "FLASER 61";
    for (int beam = 0; beam <= 60; ++beam) text << ' ' << 2 + (beam * 7 + i) % 50 / 10.0;
    const double x = 0.1 * i;
    text << ' ' << x << " 0 0 " << x << " 0 0 " << 100 + 0.1 * i << " host " << 0.1 * i << '\n';
  }
  return text.str();
}

}  // namespace

std::ostream& operator<<(std::ostream& out, const WriterCommand& command) { return out << command.name; }

const std::vector<WriterCommand>& writer_commands() {
  static const std::vector<WriterCommand> commands{
      {"merge", "merge", {"a.apgm", "b.apgm", "-o", "out.apgm"}, {"out.apgm"}, {"a.apgm", "b.apgm"}},
      {"crop",
       "crop",
       {"a.apgm", "--bbox", "1,1,30,30", "--snap", "cell", "-o", "out.apgm"},
       {"out.apgm"},
       {"a.apgm"}},
      {"resample", "resample", {"a.apgm", "--step", "5", "-o", "out.apgm"}, {"out.apgm"}, {"a.apgm"}},
      {"render", "render", {"a.apgm", "-o", "out.png"}, {"out.png"}, {"a.apgm"}},
      {"map", "map", {"run.log", "-o", "out.apgm"}, {"out.apgm"}, {"run.log"}},
      {"recode", "convert", {"a.apgm", "--level", "5", "-o", "out.apgm"}, {"out.apgm"}, {"a.apgm"}},
      {"map_server", "convert", {"a.apgm", "-o", "out.yaml"}, {"out.yaml", "out.pgm"}, {"a.apgm"}},
      {"geotiff", "convert", {"a.apgm", "-o", "out.tif"}, {"out.tif"}, {"a.apgm"}},
      {"numpy", "convert", {"a.apgm", "-o", "out.npz"}, {"out.npz"}, {"a.apgm"}},
      {"octomap", "convert", {"a.apgm", "-o", "out.ot"}, {"out.ot"}, {"a.apgm"}},
      {"from_map_server",
       "convert",
       {"grid.yaml", "-o", "out.apgm"},
       {"out.apgm"},
       {"grid.yaml", "grid.pgm"}},
      {"from_geotiff", "convert", {"grid.tif", "-o", "out.apgm"}, {"out.apgm"}, {"grid.tif"}},
      {"from_numpy", "convert", {"grid.npz", "-o", "out.apgm"}, {"out.apgm"}, {"grid.npz"}},
      {"from_octomap", "convert", {"grid.ot", "-o", "out.apgm"}, {"out.apgm"}, {"grid.ot"}},
  };
  return commands;
}

std::string tool_path(const std::string& verb) { return std::string(APGM_BIN_DIR) + "/apgm-" + verb; }

Workshop::Workshop(int patches_per_side) {
  write_map(path("a.apgm"), 1, patches_per_side);
  write_map(path("b.apgm"), 2, patches_per_side);
  write_file(path("run.log"), scan_log(30 * patches_per_side));
  for (const std::string name : {"grid.yaml", "grid.tif", "grid.npz", "grid.ot"}) {
    const Outcome made = test::run({tool_path("convert"), "-q", path("a.apgm"), "-o", path(name)});
    if (made.code != 0 && made.code != 3) throw std::runtime_error(made.err);
  }
  inputs_ = directory_.list();
}

std::vector<std::string> Workshop::line(const WriterCommand& command) const {
  std::vector<std::string> all{tool_path(command.verb), "-O", "-q", "--fsync"};
  all.insert(all.end(), command.arguments.begin(), command.arguments.end());
  return all;
}

Outcome Workshop::run(const WriterCommand& command, const std::vector<std::string>& environment) const {
  Launch launch;
  launch.directory = directory();
  launch.environment = environment;
  return test::run(line(command), launch);
}

std::vector<std::string> Workshop::expected(const WriterCommand& command) const {
  clear();
  const Outcome outcome = run(command);
  if (outcome.code != 0 && outcome.code != 3) throw std::runtime_error(command.name + ": " + outcome.err);
  return outputs(command);
}

std::vector<std::string> Workshop::old(const WriterCommand& command) const {
  std::vector<std::string> all;
  for (const std::string& output : command.outputs) {
    all.emplace_back(output.ends_with(".yaml") ? kOldYaml : "the old content of " + output);
  }
  return all;
}

void Workshop::put_old(const WriterCommand& command) const {
  clear();
  const auto contents = old(command);
  for (std::size_t i = 0; i < contents.size(); ++i) write_file(path(command.outputs[i]), contents[i]);
}

std::vector<std::string> Workshop::outputs(const WriterCommand& command) const {
  std::vector<std::string> all;
  for (const std::string& output : command.outputs) all.push_back(read_file(path(output)));
  return all;
}

void Workshop::clear() const {
  for (const std::string& name : directory_.list()) {
    if (std::ranges::count(inputs_, name) == 0) std::filesystem::remove(path(name));
  }
}

std::vector<std::string> Workshop::strangers(const WriterCommand& command) const {
  std::vector<std::string> names = directory_.list();
  std::erase_if(names, [&](const std::string& name) {
    return std::ranges::count(inputs_, name) + std::ranges::count(command.outputs, name) > 0;
  });
  return names;
}

}  // namespace apgm::test

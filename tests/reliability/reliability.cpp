// What becomes of a damaged file: every fault is done to a copy, and what readers make of it is counted
// (docs/reliability.md).
//
//   reliability [--most N] [--json FILE] [--only apgm]
//
// Ends with 1 if a damaged .apgm file was accepted, or a layer came back other than it was.

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>
#include <string>

#include "apgm/core/error.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/format/recover.hpp"
#include "apgm/format/verify.hpp"
#include "faults.hpp"
#include "readers.hpp"
#include "tests/format/sample_map.hpp"

namespace apgm::test {
namespace {

using nlohmann::json;

std::span<const std::byte> bytes_of(const std::string& file) { return std::as_bytes(std::span(file)); }

std::string apgm_file(std::uint64_t seed, int patches, int max_step) {
  const Map map = sample_map(seed, patches, max_step);
  std::vector<std::byte> bytes;
  Writer writer(bytes, map.header());
  stream(map, writer);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

bool verify_finds(const std::string& file) {
  try {
    return !verify(bytes_of(file)).valid();
  } catch (const Error&) {
    return true;
  }
}

/// Opening and loading every layer, as any use of the whole map does.
bool reading_finds(const std::string& file) {
  try {
    const Reader reader(bytes_of(file));
    const auto cursor = reader.patches();
    PatchInfo patch;
    Layer layer;
    while (cursor->next(patch)) {
      for (const LayerInfo& info : patch.layers) reader.load(info, layer);
    }
    return false;
  } catch (const Error&) {
    return true;
  }
}

/// What recovery makes of one file.
struct Saved {
  std::uint64_t layers = 0;
  std::uint64_t changed = 0;  // that are not what they were: must stay 0
  bool told = true;           // a loss was told of where there is one, and only there
  bool header = false;
};

class Original {
 public:
  explicit Original(const std::string& file) {
    const Reader reader(bytes_of(file));
    types_ = reader.header().types;
    const auto cursor = reader.patches();
    PatchInfo patch;
    while (cursor->next(patch)) {
      for (const LayerInfo& info : patch.layers) layers_.push_back(info);
    }
    std::ranges::sort(layers_, {}, place);
  }
  std::uint64_t layers() const { return layers_.size(); }
  bool holds(const LayerInfo& info, const TypeTable& types) const {
    const auto at = std::ranges::lower_bound(layers_, place(info), {}, place);
    return at != layers_.end() && place(*at) == place(info) && at->content_hash == info.content_hash &&
           at->step == info.step && types[info.type] == types_[at->type];
  }

 private:
  static std::tuple<std::uint64_t, TypeId> place(const LayerInfo& info) {
    return {curve_key(info.patch), info.type};
  }
  TypeTable types_;
  std::vector<LayerInfo> layers_;
};

Saved recover(const std::string& file, const Original& original) {
  Saved saved;
  try {
    RecoverOptions options;
    options.threads = 1;
    const Recovery recovery(bytes_of(file), options);
    saved.header = true;
    const auto cursor = recovery.patches();
    PatchInfo patch;
    Layer layer;
    while (cursor->next(patch)) {
      for (const LayerInfo& info : patch.layers) {
        recovery.load(info, layer);
        ++saved.layers;
        saved.changed += !original.holds(info, recovery.header().types);
      }
    }
    saved.told = saved.layers == original.layers() || recovery.report().loss_count > 0;
  } catch (const Error&) {
    // Nothing could be saved, and that was said.
  }
  return saved;
}

json try_apgm(const std::string& name, const std::string& file, const FaultSet& set,
              const Original& original) {
  std::uint64_t verified = 0, read = 0, silent = 0, whole = 0, layers = 0, changed = 0, untold = 0, none = 0;
  for (const Fault& fault : set.faults) {
    const std::string bad = with_fault(file, fault);
    const bool by_verify = verify_finds(bad), by_reading = reading_finds(bad);
    verified += by_verify;
    read += by_reading;
    silent += !by_verify;
    const Saved saved = recover(bad, original);
    whole += saved.layers == original.layers();
    layers += saved.layers;
    changed += saved.changed;
    untold += !saved.told;
    none += saved.layers == 0;
  }
  const double tried = static_cast<double>(set.faults.size());
  return {{"format", name},
          {"file_bytes", file.size()},
          {"layers", original.layers()},
          {"fault", set.name},
          {"choice", set.choice},
          {"tried", set.faults.size()},
          {"detected_by_verify", verified},
          {"detected_by_reading_all", read},
          {"silent", silent},
          {"recovered_whole", whole},
          {"nothing_recovered", none},
          {"layers_saved_percent",
           tried == 0 ? 100
                      : 100 * static_cast<double>(layers) / (tried * static_cast<double>(original.layers()))},
          {"layers_changed", changed},
          {"losses_not_told", untold}};
}

json try_foreign(Format& format, const FaultSet& set) {
  const std::string answers = read_apart(
      format, set.faults.size(), [&](std::size_t i) { return with_fault(format.file(), set.faults[i]); });
  const auto count = [&](Answer answer) {
    return static_cast<std::uint64_t>(std::ranges::count(answers, static_cast<char>(answer)));
  };
  return {{"format", format.name()},
          {"file_bytes", format.file().size()},
          {"fault", set.name},
          {"choice", set.choice},
          {"tried", set.faults.size()},
          {"detected", count(Answer::kDetected)},
          {"silent", count(Answer::kWrong)},
          {"accepted_unchanged", count(Answer::kSame)},
          {"crashed", count(Answer::kCrash)},
          {"hung", count(Answer::kHang)}};
}

void print_apgm(const json& row) {
  std::printf("| %s | %s (%s) | %s | %s | %s | %s | %s | %.2f %% |\n",
              row["format"].get<std::string>().c_str(), row["fault"].get<std::string>().c_str(),
              row["choice"].get<std::string>().c_str(), row["tried"].dump().c_str(),
              row["detected_by_verify"].dump().c_str(), row["detected_by_reading_all"].dump().c_str(),
              row["silent"].dump().c_str(), row["recovered_whole"].dump().c_str(),
              row["layers_saved_percent"].get<double>());
}

void print_foreign(const json& row) {
  std::printf("| %s | %s (%s) | %s | %s | %s | %s | %s |\n", row["format"].get<std::string>().c_str(),
              row["fault"].get<std::string>().c_str(), row["choice"].get<std::string>().c_str(),
              row["tried"].dump().c_str(), row["detected"].dump().c_str(), row["silent"].dump().c_str(),
              row["accepted_unchanged"].dump().c_str(),
              (row["crashed"].dump() + " / " + row["hung"].dump()).c_str());
}

struct Options {
  std::size_t most = 20'000;
  std::string json_file;
  bool only_apgm = false;
};

Options parse(const std::vector<std::string>& arguments) {
  Options options;
  for (std::size_t i = 0; i < arguments.size(); i += 2) {
    if (i + 1 == arguments.size()) throw std::runtime_error(arguments[i] + " needs a value");
    if (arguments[i] == "--most") {
      options.most = std::stoul(arguments[i + 1]);
    } else if (arguments[i] == "--json") {
      options.json_file = arguments[i + 1];
    } else if (arguments[i] == "--only" && arguments[i + 1] == "apgm") {
      options.only_apgm = true;
    } else {
      throw std::runtime_error("usage: reliability [--most N] [--json FILE] [--only apgm]");
    }
  }
  return options;
}

int run(const Options& options) {
  json rows = json::array();
  bool kept = true;
  std::puts(
      "| file | fault | tried | found by verify | found by reading all | silent | recovered whole | layers "
      "saved |");
  std::puts("|---|---|---:|---:|---:|---:|---:|---:|");
  const std::vector<std::string> files{apgm_file(21, 6, 4), apgm_file(22, 60, 7)};
  for (const std::string& file : files) {
    const Original original(file);
    const std::string name = ".apgm, " + std::to_string(file.size()) + " bytes";
    // A large file costs more a fault.
    const std::size_t most =
        file.size() > 100'000 ? std::max<std::size_t>(1, options.most / 20) : options.most;
    for (const FaultSet& set : faults_for(file, most)) {
      rows.push_back(try_apgm(name, file, set, original));
      print_apgm(rows.back());
      kept = kept && rows.back()["silent"] == 0 && rows.back()["layers_changed"] == 0 &&
             rows.back()["losses_not_told"] == 0;
    }
  }
  if (!options.only_apgm) {
    std::puts("\n| file | fault | tried | found | silent, wrong | accepted, unchanged | crashed / hung |");
    std::puts("|---|---|---:|---:|---:|---:|---:|");
    std::vector<std::unique_ptr<Format>> formats;
#ifdef APGM_HAS_OCTOMAP
    formats.push_back(octomap_ot());
    formats.push_back(octomap_bt());
#endif
#ifdef APGM_HAS_GDAL
    formats.push_back(geotiff_zstd());
#endif
    for (const auto& format : formats) {
      for (const FaultSet& set : faults_for(format->file(), options.most)) {
        rows.push_back(try_foreign(*format, set));
        print_foreign(rows.back());
      }
    }
  }
  if (!options.json_file.empty()) std::ofstream(options.json_file) << rows.dump(1) << "\n";
  return kept ? 0 : 1;
}

}  // namespace
}  // namespace apgm::test

int main(int argc, char** argv) {
  try {
    return apgm::test::run(apgm::test::parse({argv + 1, argv + argc}));
  } catch (const std::exception& e) {
    std::fprintf(stderr, "reliability: %s\n", e.what());
    return 2;
  }
}

#include "converters/numpy/export.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>

#include "apgm/fuse/resample.hpp"
#include "converters/common/choose.hpp"
#include "converters/common/file.hpp"
#include "converters/numpy/import.hpp"
#include "converters/numpy/meta.hpp"
#include "converters/numpy/npy.hpp"
#include "converters/numpy/npz_writer.hpp"

namespace apgm::converters {
namespace {

constexpr std::array<std::string_view, 2> kCompressions{"deflate", "none"};

std::optional<int> wanted_step(const SettingsReader& settings) {
  const auto step = settings.number("step", 0, kMaxStep);
  if (step && *step != std::floor(*step)) settings.refuse("step", "is not a whole number");
  return step ? std::optional<int>(static_cast<int>(*step)) : std::nullopt;
}

/// An array to write: the patches of a type that have one step, or all of them brought to one.
struct ArrayPlan {
  TypeId type = 0;
  int step = 0;
  PatchRange range;
};

std::vector<ArrayPlan> plan_arrays(const PatchSource& source, const std::string& layer,
                                   std::optional<int> step) {
  const TypeTable& types = source.header().types;
  if (!layer.empty() && !types.find(layer)) {
    throw Error(ErrorCode::kInvalidArgument, "the map has no layer '" + layer + "'");
  }
  std::map<std::pair<TypeId, int>, PatchRange> ranges;
  const auto cursor = source.patches();
  PatchInfo patch;
  while (cursor->next(patch)) {
    for (const LayerInfo& info : patch.layers) {
      if (layer.empty() || types[info.type].name == layer) {
        ranges[{info.type, step.value_or(info.step)}].add(info.patch);
      }
    }
  }
  std::vector<ArrayPlan> plans;
  for (const auto& [key, range] : ranges) plans.push_back({key.first, key.second, range});
  return plans;
}

/// Writes one array: channel by channel, and in each from south to north, a row of patches at a time.
class ArrayWriter {
 public:
  using Out = std::function<void(std::span<const std::byte>)>;
  ArrayWriter(const PatchSource& source, bool one_step, const RunOptions& run)
      : source_(source), one_step_(one_step), run_(run) {}

  void write(const ArrayPlan& plan, const Out& out) {
    const std::int64_t side = std::int64_t{1} << plan.step;
    const std::int64_t columns = (std::int64_t{plan.range.max.x} - plan.range.min.x + 1) * side;
    const LayerType& type = source_.header().types[plan.type];
    const TypeId chosen[] = {plan.type};
    check_budget(run_.max_memory_bytes,
                 static_cast<std::uint64_t>(columns * side) * sizeof(float) +
                     reading_bytes(source_, chosen, plan.step),
                 "an array is written a row of patches at a time", "crop the map, or resample it");
    std::vector<float> strip(static_cast<std::size_t>(columns * side));
    for (int c = 0; c < static_cast<int>(type.channels.size()); ++c) {
      for (std::int32_t y = plan.range.min.y;; ++y) {
        std::fill(strip.begin(), strip.end(), type.background(c));
        fill(plan, c, y, columns, strip);
        out(std::as_bytes(std::span(strip)));
        if (y == plan.range.max.y) break;
      }
    }
  }

  std::uint64_t split = 0, merged = 0;

 private:
  void fill(const ArrayPlan& plan, int channel, std::int32_t y, std::int64_t columns,
            std::vector<float>& strip) {
    check_cancelled(run_);
    const auto cursor = source_.patches(PatchRange{{plan.range.min.x, y}, {plan.range.max.x, y}});
    PatchInfo patch;
    while (cursor->next(patch)) {
      for (const LayerInfo& info : patch.layers) {
        if (info.type != plan.type || (!one_step_ && info.step != plan.step)) continue;
        const Layer& cells = load(info, plan.step, channel == 0);
        const auto plane = cells.plane(channel);
        const std::int64_t side = cells.side();
        const std::int64_t left = (std::int64_t{info.patch.x} - plan.range.min.x) * side;
        for (std::int64_t b = 0; b < side; ++b) {
          std::copy_n(plane.begin() + b * side, side, strip.begin() + b * columns + left);
        }
      }
    }
  }

  const Layer& load(const LayerInfo& info, int step, bool count) {
    source_.load(info, layer_);
    if (layer_.step() == step) return layer_;
    if (count) (layer_.step() < step ? split : merged) += 1;
    resample(layer_, source_.header().types[info.type], step, fitted_);
    return fitted_;
  }

  const PatchSource& source_;
  bool one_step_;
  const RunOptions& run_;
  Layer layer_, fitted_;
};

NpyHeader header_of(const ArrayPlan& plan, const LayerType& type) {
  const std::int64_t side = std::int64_t{1} << plan.step;
  NpyHeader header;
  header.shape = {static_cast<std::int64_t>(type.channels.size()),
                  (std::int64_t{plan.range.max.y} - plan.range.min.y + 1) * side,
                  (std::int64_t{plan.range.max.x} - plan.range.min.x + 1) * side};
  constexpr double kMostBytes = 4.2e9;
  const double bytes = 4.0 * static_cast<double>(header.shape[0]) * static_cast<double>(header.shape[1]) *
                       static_cast<double>(header.shape[2]);
  if (bytes > kMostBytes) {
    throw Error(ErrorCode::kLimit, "the array of layer '" + type.name + "' would have " +
                                       std::to_string(header.shape[1]) + " x " +
                                       std::to_string(header.shape[2]) + " cells, more than 4 GiB")
        .hint("crop the map, or set a coarser step");
  }
  return header;
}

NumpyMeta meta_of(const PatchSource& source, const std::vector<ArrayPlan>& plans) {
  NumpyMeta meta;
  meta.frame = source.header().frame;
  meta.stamp_ns = source.header().stamp_ns;
  for (const ArrayPlan& plan : plans) {
    ArrayMeta array;
    array.type = source.header().types[plan.type];
    array.step = plan.step;
    array.cell_x = std::int64_t{plan.range.min.x} << plan.step;
    array.cell_y = std::int64_t{plan.range.min.y} << plan.step;
    const auto same = [&](const ArrayPlan& p) { return p.type == plan.type; };
    const bool alone = std::ranges::count_if(plans, same) == 1;
    array.array = array.type.name + (alone ? "" : ".step" + std::to_string(plan.step)) + ".npy";
    meta.arrays.push_back(std::move(array));
  }
  return meta;
}

/// What the arrays do not hold. Before a file appears: whoever listens may refuse it.
void report(const PatchSource& source, const std::vector<ArrayPlan>& plans, const ArrayWriter& arrays,
            const Findings& findings) {
  const auto loss = [&](std::uint64_t count, const char* what) {
    if (count == 0 || !findings) return;
    findings({Finding::Kind::kLoss, std::to_string(count) + what + std::to_string(plans[0].step)});
  };
  loss(arrays.split, " layers of coarser cells are split to step ");
  loss(arrays.merged, " layers of finer cells are merged to step ");
  std::vector<TypeId> chosen;
  for (const ArrayPlan& plan : plans) chosen.push_back(plan.type);
  report_left_out(source, chosen, findings);
}

void write_npz(const PatchSource& source, const std::vector<ArrayPlan>& plans, const NumpyMeta& meta,
               const WriteRequest& request, bool compressed, ArrayWriter& arrays) {
  OutputFile file(request.path, request.output);
  NpzWriter archive(file, compressed);
  const auto write = [&](std::span<const std::byte> bytes) { archive.write(bytes); };
  const std::string json = to_json(meta);
  archive.begin("meta.json");
  archive.write(std::as_bytes(std::span(json)));
  archive.end();
  for (std::size_t i = 0; i < plans.size(); ++i) {
    const std::string head = npy_head(header_of(plans[i], source.header().types[plans[i].type]));
    archive.begin(meta.arrays[i].array);
    archive.write(std::as_bytes(std::span(head)));
    arrays.write(plans[i], write);
    archive.end();
    if (request.run.progress) request.run.progress(i + 1, plans.size());
  }
  archive.finish();
  report(source, plans, arrays, request.run.findings);
  file.flush();
  file.commit();
}

void write_single(const PatchSource& source, const std::vector<ArrayPlan>& plans, NumpyMeta meta,
                  const WriteRequest& request, ArrayWriter& arrays) {
  if (plans.size() != 1) {
    throw Error(ErrorCode::kInvalidArgument, "the map gives " + std::to_string(plans.size()) +
                                                 " arrays, and '" + request.path + "' holds one")
        .hint("an .npz holds all; --layer chooses a layer, --set step=R brings it to one resolution");
  }
  meta.arrays[0].array = std::filesystem::path(request.path).filename().string();
  OutputFile side(json_beside(request.path), request.output);
  OutputFile file(request.path, request.output);
  file.write(npy_head(header_of(plans[0], source.header().types[plans[0].type])));
  arrays.write(plans[0], [&](std::span<const std::byte> bytes) { file.write(bytes); });
  side.write(to_json(meta));
  report(source, plans, arrays, request.run.findings);
  file.flush();
  side.flush();
  // The JSON first: an array that can be found has its meaning beside it.
  side.commit();
  file.commit();
}

}  // namespace

void check_array_export(const SettingsReader& settings) {
  wanted_step(settings);
  settings.choice("compression", kCompressions);
}

void export_arrays(const PatchSource& source, const WriteRequest& request, const SettingsReader& settings) {
  check_array_export(settings);
  const std::string extension = extension_of(request.path);
  if (extension != ".npz" && extension != ".npy") {
    throw Error(ErrorCode::kInvalidArgument, "'" + request.path + "' does not end in .npz or .npy")
        .hint(".npz holds all layers, .npy one, with FILE.json beside it");
  }
  const auto step = wanted_step(settings);
  const auto plans = plan_arrays(source, request.layer, step);
  for (const ArrayPlan& plan : plans) header_of(plan, source.header().types[plan.type]);
  ArrayWriter arrays(source, step.has_value(), request.run);
  const NumpyMeta meta = meta_of(source, plans);
  if (extension == ".npz") {
    write_npz(source, plans, meta, request, settings.choice("compression", kCompressions) != "none", arrays);
  } else {
    write_single(source, plans, meta, request, arrays);
  }
}

}  // namespace apgm::converters

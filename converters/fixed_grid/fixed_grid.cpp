#include "converters/fixed_grid/fixed_grid.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "apgm/core/error.hpp"
#include "converters/common/file.hpp"
#include "converters/fixed_grid/choose_layout.hpp"
#include "converters/fixed_grid/layout_file.hpp"
#include "converters/fixed_grid/losses.hpp"

namespace apgm::converters {
namespace {

constexpr std::uint64_t kMaxFileBytes = std::uint64_t{4} << 30;

/// The map with the layers of one type only.
Map only(const PatchSource& source, const std::string& layer) {
  const auto wanted = source.header().types.find(layer);
  if (!wanted) {
    throw Error(ErrorCode::kInvalidArgument, "the map has no layer '" + printable(layer) + "'");
  }
  MapHeader header = source.header();
  header.types = TypeTable({source.header().types[*wanted]});
  Map map(std::move(header));
  const auto cursor = source.patches();
  PatchInfo info;
  while (cursor->next(info)) {
    for (const LayerInfo& of : info.layers) {
      if (of.type == *wanted) source.load(of, map.layer(info.patch, 0, of.step));
    }
  }
  return map;
}

/// The frame of the file with what the settings change of it. @throws Error{kInvalidArgument|kLimit}
Frame frame_of(const SettingsReader& settings, Frame frame) {
  if (const auto datum = settings.point("datum")) {
    frame.datum_x_um = to_micrometres(datum->x_m);
    frame.datum_y_um = to_micrometres(datum->y_m);
  }
  if (const auto edge_m = settings.number("edge_m", 1e-3, 1e4)) frame.edge_um = to_micrometres(*edge_m);
  read_names(settings, frame);
  frame.check();
  return frame;
}

void report(const Layout& layout, const PatchSource& map, const Findings& findings) {
  if (!findings) return;
  const auto fates = cell_fates(layout, map);
  for (std::size_t t = 0; t < fates.size(); ++t) {
    const std::string layer = "layer '" + map.header().types[static_cast<TypeId>(t)].name + "': ";
    const std::string of = " of " + std::to_string(fates[t].known) + " cells with data ";
    const auto tell = [&](Finding::Kind kind, std::uint64_t count, const char* what) {
      if (count > 0) findings({kind, layer + std::to_string(count) + of + what});
    };
    tell(Finding::Kind::kLoss, fates[t].outside, "lie outside the layout and are lost");
    tell(Finding::Kind::kLoss, fates[t].merged, "are merged into larger ones");
    tell(Finding::Kind::kNote, fates[t].split, "are split into smaller ones");
  }
}

void report_split(const Layout& layout, const Map& map, const Findings& findings) {
  if (!findings) return;
  const auto split = cells_split(layout, map);
  for (std::size_t t = 0; t < split.size(); ++t) {
    if (split[t] == 0) continue;
    findings({Finding::Kind::kNote, "layer '" + map.header().types[static_cast<TypeId>(t)].name +
                                        "': " + std::to_string(split[t]) +
                                        " cells with data are split into smaller ones"});
  }
}

class FixedGridConverter final : public Converter {
 public:
  std::string_view name() const override { return "fixed_grid"; }
  std::string_view description() const override {
    return "fixed layouts of cells: non-uniform or moving grid, sub-maps of one resolution";
  }
  std::vector<std::string> extensions() const override { return {".apfg"}; }
  std::vector<SettingSpec> settings() const override {
    std::vector<SettingSpec> specs = layout_settings();
    for (const SettingSpec& spec : frame_settings()) {
      specs.push_back(spec);
      specs.back().default_value = "that of the file";
    }
    return specs;
  }
  std::vector<std::string> losses() const override {
    return {"writing: cells outside the layout are left out",
            "writing: cells finer than the layout's are merged, coarser ones split",
            "reading: cells that share a patch with finer ones are split",
            "writing: stamps of layers, metadata and history are left out"};
  }
  bool sniffs(std::string_view /*path*/, std::span<const std::byte> head) const override {
    return head.size() >= kFixedGridMagic.size() &&
           std::memcmp(head.data(), kFixedGridMagic.data(), kFixedGridMagic.size()) == 0;
  }
  void check_settings(const Settings& given, Use use) const override {
    const SettingsReader settings(*this, given, use);
    use == Use::kReading ? static_cast<void>(frame_of(settings, Frame{})) : check_layout_settings(settings);
  }
  std::unique_ptr<PatchSource> open(const ReadRequest& request) const override {
    const SettingsReader settings(*this, request.settings, Use::kReading);
    return naming(request.path, [&] {
      const std::uint64_t budget = request.max_memory_bytes;
      const std::string bytes =
          read_file(request.path, budget == 0 ? kMaxFileBytes : std::min(budget, kMaxFileBytes));
      const auto layout = decode_layout(std::as_bytes(std::span(bytes)), budget_left(budget, bytes.size()));
      auto map = std::make_unique<Map>(to_map(*layout, frame_of(settings, layout->frame())));
      report_split(*layout, *map, request.findings);
      return map;
    });
  }
  void write(const PatchSource& source, const WriteRequest& request) const override {
    const SettingsReader settings(*this, request.settings, Use::kWriting);
    if (!request.layer.empty()) {
      write_all(only(source, request.layer), request, settings);
    } else {
      write_all(source, request, settings);
    }
  }

 private:
  static void write_all(const PatchSource& map, const WriteRequest& request, const SettingsReader& settings) {
    if (const auto plan = settings.text("plan")) check_not_an_input(request.path, std::array{*plan});
    OutputFile file(request.path, request.output);
    const auto layout = choose_layout(settings, map, request.run.max_memory_bytes);
    fill(*layout, map);
    // Sub-maps beyond the horizon were made to be filled.
    if (settings.has("horizon_m")) layout->move_to(vehicle_of(settings, map));
    report(*layout, map, request.run.findings);
    file.write(encode_layout(*layout));
    file.commit();
  }
};

}  // namespace

const Converter& fixed_grid() {
  static const FixedGridConverter converter;
  return converter;
}

}  // namespace apgm::converters

#include "converters/octomap/octomap.hpp"

#include <array>
#include <cmath>

#include "apgm/core/budget.hpp"
#include "converters/common/file.hpp"
#include "converters/octomap/export.hpp"
#include "converters/octomap/octree_source.hpp"

namespace apgm::converters {
namespace {

constexpr std::array<std::string_view, 2> kModes{"projection", "slices"};

/// Keys of the voxels whose centre lies in [z_min, z_max).
KeyRange heights_of(const SettingsReader& settings, double resolution_m) {
  constexpr double kEnd = 1 << kTreeDepth;
  const auto first_at = [&](double z_m) {
    const double key = std::ceil(z_m / resolution_m - 0.5 - 1e-9) + kOriginKey;
    return static_cast<int>(std::clamp(key, 0.0, kEnd));
  };
  const auto z_min = settings.number("z_min"), z_max = settings.number("z_max");
  if (z_min && z_max && *z_min >= *z_max) settings.refuse("z_min", "is not below z_max");
  return {z_min ? first_at(*z_min) : 0, z_max ? first_at(*z_max) : static_cast<int>(kEnd)};
}

/// Calls `action`, which works beside `used` bytes: a budget that its refusal names holds them too.
template <class Action>
auto counting(std::uint64_t used, Action action) {
  try {
    return action();
  } catch (const Error& error) {
    const auto hint = budget_hint(error);
    if (!hint) throw;
    constexpr std::string_view kOr = ", or ";
    const bool more = hint->rest.starts_with(kOr);
    throw over_budget(error.message(), used + (hint->least_mebibytes << 20),
                      std::string(more ? hint->rest.substr(kOr.size()) : ""));
  }
}

class OctomapConverter final : public Converter {
 public:
  std::string_view name() const override { return "octomap"; }
  std::string_view description() const override { return "OctoMap octrees of type OcTree"; }
  std::vector<std::string> extensions() const override { return {".bt", ".ot"}; }

  std::vector<SettingSpec> settings() const override {
    std::vector<SettingSpec> specs{
        {"mode", "projection (columns) or slices (a layer a height)", "projection"},
        {"z_min", "lower end of the heights in metres; reading: all; writing a layer without a height: 0", "",
         true, true},
        {"z_max", "upper end of the heights in metres; reading: all; writing: one voxel above z_min", "",
         true, true},
        {"origin", "X,Y in metres: the point that becomes the octree's origin", "0,0", false, true}};
    for (const SettingSpec& spec : frame_settings()) {
      specs.push_back(spec);
      if (spec.key == "datum") specs.back().default_value = "0,0";
    }
    return specs;
  }

  std::vector<std::string> losses() const override {
    return {"reading: mode=projection keeps no heights",
            "reading: voxels of probability exactly 0.5 become cells without data",
            "reading .ot: a mass is a float32, which moves a probability by 3e-8 at most",
            "writing: the probability BetP(O) is kept, not the masses it came from",
            "writing .bt: only occupied (BetP(O) >= 0.5) or free is kept",
            "writing: frame, time, metadata, and layers that are not occupancy are left out"};
  }

  bool sniffs(std::string_view /*path*/, std::span<const std::byte> head) const override {
    return is_octree({reinterpret_cast<const char*>(head.data()), head.size()});
  }

  void check_settings(const Settings& given, Use use) const override {
    const SettingsReader settings(*this, given, use);
    heights_of(settings, 1.0);
    if (use == Use::kWriting) {
      settings.point("origin");
      return;
    }
    settings.choice("mode", kModes);
    fit_grid({1.0, {}, 0}, settings, {});
  }

  std::unique_ptr<PatchSource> open(const ReadRequest& request) const override {
    check_settings(request.settings, Use::kReading);  // before a large file is read
    const SettingsReader settings(*this, request.settings, Use::kReading);
    const auto mode = settings.choice("mode", kModes).value_or("projection");
    return naming(request.path, [&] {
      auto tree = read_octree(request.path, request.max_memory_bytes);
      const std::uint64_t used = octree_memory(tree->size(), tree->size() - tree->getNumLeafNodes());
      const std::uint64_t left = budget_left(request.max_memory_bytes, used);
      const ForeignGrid grid{tree->getResolution(), {}, 0};
      const GridFit fit = fit_grid(grid, settings, request.findings);
      return counting(used, [&] {
        auto native = std::make_unique<OctreeSource>(
            std::move(tree), fit, mode == "slices" ? OctreeMode::kSlices : OctreeMode::kProjection,
            heights_of(settings, grid.cell_m), request.findings, left);
        return place(std::move(native), grid, fit, request.findings, left);
      });
    });
  }

  void write(const PatchSource& source, const WriteRequest& request) const override {
    export_octree(source, request, SettingsReader(*this, request.settings, SettingsReader::Use::kWriting));
  }
};

}  // namespace

const Converter& octomap() {
  static const OctomapConverter converter;
  return converter;
}

}  // namespace apgm::converters

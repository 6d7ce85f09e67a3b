#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "apgm/core/summary.hpp"
#include "apgm/ops/merge.hpp"
#include "tools/common/plane_picture.hpp"

namespace apgm::tools {

inline constexpr Colour kNothingFused{132, 148, 168};

/// Collects where and how much the inputs of a merge contradict each other, as a grey picture: white for
/// K = 0, black for K = 1, blue-grey for patches with nothing to fuse. Where several layer types were fused,
/// the greatest K of them shows. No conflict vanishes (PlanePicture).
class ConflictPicture final : public ConflictSink {
 public:
  explicit ConflictPicture(const PlanePictureOptions& options = {}) : picture_(options) {}

  /// Most memory it and its picture take.
  /// @param frame  of the result
  /// @param most_step  of the result, by what is required
  static std::uint64_t most_bytes(std::span<const MergeInput> inputs, const Frame& frame, int most_step) {
    PatchRange range;
    double patches = 0;
    int finest = 0;
    for (const MergeInput& input : inputs) {
      const Summary summary = input.source->summary();
      if (summary.range.empty()) continue;
      const Frame& own = input.source->header().frame;
      const Box box = own.box_m(summary.range);
      range.add(frame.patch_at(box.min));
      range.add(frame.patch_at(box.max));
      finest = std::max(finest, finest_step(summary).value_or(0));
      const bool same_patches = own.edge_um == frame.edge_um && own.datum_x_um == frame.datum_x_um &&
                                own.datum_y_um == frame.datum_y_um;
      const double side = same_patches ? 1 : std::ceil(own.edge_m() / frame.edge_m()) + 1;
      patches += static_cast<double>(summary.patches) * side * side;
    }
    finest = std::min(finest, most_step);
    // Only what two inputs hold is fused.
    const double cells = std::ldexp(patches / 2, 2 * finest);
    return PlanePicture::most_bytes({}, range, finest, static_cast<std::uint64_t>(std::min(cells, 1e18)));
  }

  void put(PatchIndex patch, TypeId /*type*/, int step, std::span<const float> conflict) override {
    std::vector<std::uint8_t> cells(conflict.size());  // 255 K
    for (std::size_t i = 0; i < conflict.size(); ++i) {
      // Rounded up: the least conflict is not shown as none.
      cells[i] = static_cast<std::uint8_t>(std::ceil(std::min(1.0f, std::max(0.0f, conflict[i])) * 255.0f));
    }
    picture_.put(patch, step, std::move(cells));
  }

  /// What was collected; an empty raster if nothing was.
  Rendering rendering(const Frame& frame) const {
    const auto grey = [](int k) {
      const auto shade = static_cast<std::uint8_t>(255 - k);
      return Colour{shade, shade, shade};
    };
    std::array<Colour, 256> colours;
    for (int k = 0; k < 256; ++k) colours[static_cast<std::size_t>(k)] = grey(k);
    Rendering out = picture_.rendering(frame, colours, kNothingFused);
    for (const int tenths : {0, 5, 10}) {
      out.legend.scale.push_back({fmt::format("K = {:g}", tenths / 10.0), grey(255 * tenths / 10)});
    }
    out.legend.entries = {{"nothing to fuse", kNothingFused}};
    return out;
  }

 private:
  PlanePicture picture_;
};

}  // namespace apgm::tools

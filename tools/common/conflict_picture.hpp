#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "apgm/ops/merge.hpp"
#include "tools/common/plane_picture.hpp"

namespace apgm::tools {

inline constexpr Colour kNothingFused{132, 148, 168};

/// Collects where and how much the inputs of a merge contradict each other, as a grey picture: white for
/// K = 0, black for K = 1, blue-grey for patches with nothing to fuse. Where several layer types were fused,
/// the greatest K of them shows. No conflict vanishes (PlanePicture).
class ConflictPicture final : public ConflictSink {
 public:
  explicit ConflictPicture(std::uint64_t most_cells = std::uint64_t{1} << 26, int max_side = 2048)
      : picture_({.most_cells = most_cells, .max_side = max_side}) {}

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

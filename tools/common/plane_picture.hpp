#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "apgm/core/budget.hpp"
#include "apgm/core/frame.hpp"
#include "apgm/ops/render.hpp"
#include "apgm/ops/run.hpp"

namespace apgm::tools {

struct PlanePictureOptions {
  std::uint64_t most_cells = std::uint64_t{1} << 26;  ///< kept, one byte each
  int max_side = 2048;                                ///< pixels
  int min_side = 0;      ///< cells are drawn larger, doubling, while the longer side stays within this
  int min_patch_px = 0;  ///< patch squares are listed if a patch is at least this wide; 0: never
};

/// Collects one byte a cell of some patches, as a picture. The greatest byte wins: where several planes lie
/// over each other, where cells are merged 2 x 2 beyond `most_cells`, and in pixels that hold several cells
/// or patches. So nothing that is given a high byte vanishes.
class PlanePicture {
 public:
  explicit PlanePicture(const PlanePictureOptions& options) : options_(options) {}

  /// Most memory that planes of so many cells take, and their picture on its way to a PNG.
  /// @param range   of their patches
  /// @param finest  step of the planes
  static std::uint64_t most_bytes(const PlanePictureOptions& options, const PatchRange& range, int finest,
                                  std::uint64_t cells);

  /// @param cells  4^step, rows of cells as in Layer
  void put(PatchIndex patch, int step, std::vector<std::uint8_t> cells);
  bool empty() const { return planes_.empty(); }
  /// @param colours  by byte
  /// @param nothing  where no plane is
  /// @return  without a legend; an empty raster if nothing was put
  Rendering rendering(const Frame& frame, std::span<const Colour> colours, Colour nothing) const;

 private:
  struct Plane {
    int step = 0;
    std::vector<std::uint8_t> cells;  // as a layer's plane
  };
  // Pixels of all space: a patch is 2^step of them wide, or a pixel 2^-step patches.
  struct View {
    int step = 0;
    std::int64_t left = 0, bottom = 0, right = 0, top = 0;
    std::int64_t width() const { return right - left; }
    std::int64_t height() const { return top - bottom; }
    static std::int64_t first(std::int64_t index, int step) {
      return step >= 0 ? index * (std::int64_t{1} << step) : index >> -step;
    }
    static std::int64_t end(std::int64_t index, int step) {
      return step >= 0 ? (index + 1) * (std::int64_t{1} << step) : (index >> -step) + 1;
    }
  };
  static void halve(Plane& plane);
  void keep_within_limit();
  View view() const;
  static View view_of(const PatchRange& range, int finest, const PlanePictureOptions& options);
  static void draw(const Plane& plane, PatchIndex patch, const View& view,
                   std::vector<std::uint16_t>& canvas);
  void list_patches(const View& view, Rendering& out) const;

  PlanePictureOptions options_;
  int finest_kept_ = kMaxStep;
  std::uint64_t cells_ = 0;
  std::map<PatchIndex, Plane> planes_;
};

/// Does work while a picture is collected, which takes `bytes` of the budget: `work(run)` with what is left.
/// @throws over_budget() that says how much both need
template <class Work>
auto work_beside_picture(std::uint64_t bytes, RunOptions run, Work&& work) {
  if (bytes == 0) return work(run);
  if (run.max_memory_bytes != 0) {
    check_budget(run.max_memory_bytes, bytes, "a picture is made in memory");
    run.max_memory_bytes = std::max<std::uint64_t>(run.max_memory_bytes - bytes, 1);
  }
  try {
    return work(run);
  } catch (const Error& e) {
    const auto hint = budget_hint(e);
    if (!hint) throw;
    throw over_budget(e.message(), bytes + (hint->least_mebibytes << 20));
  }
}

}  // namespace apgm::tools

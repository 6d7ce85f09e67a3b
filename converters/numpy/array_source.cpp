#include "converters/numpy/array_source.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "converters/common/settings.hpp"

namespace apgm::converters {
namespace {

constexpr float kMassSlack = 1e-6f;  // as canonicalise

[[noreturn]] void fail(const CellArray& array, std::size_t channel, std::int64_t cell, const std::string& why,
                       const char* hint) {
  throw Error(ErrorCode::kDamaged, "array '" + printable(array.meta.array) + "' at [" +
                                       std::to_string(channel) + ", " + std::to_string(cell / array.columns) +
                                       ", " + std::to_string(cell % array.columns) + "]: " + why)
      .hint(hint);
}

std::string shown(float v) { return std::isnan(v) ? "nan" : format_number(static_cast<double>(v)); }

/// Whether a cell holds data. @throws Error{kDamaged} if its values cannot be a cell's
bool is_known(const CellArray& array, std::int64_t cell) {
  const LayerType& type = array.meta.type;
  const auto plane = static_cast<std::size_t>(array.rows * array.columns);
  float sum = 0;
  bool known = false;
  for (std::size_t c = 0; c < type.channels.size(); ++c) {
    const float v = array.values[c * plane + static_cast<std::size_t>(cell)];
    const float background = type.background(static_cast<int>(c));
    if (type.is_evidence() && !(v >= 0 && v <= 1)) {
      fail(array, c, cell, shown(v) + " is no mass",
           "masses lie in 0..1, and all are 0 where nothing is known (m(Omega) is 1)");
    }
    if (std::isinf(v)) {
      fail(array, c, cell, "an infinite value", "values are finite, or NaN where nothing is known");
    }
    known = known || (std::isnan(background) ? !std::isnan(v) : v != background);
    sum += v;
  }
  if (type.is_evidence() && (sum > 1 + kMassSlack || (type.stores_omega() && sum < 1 - kMassSlack))) {
    fail(array, 0, cell, "the masses sum to " + shown(sum),
         type.stores_omega() ? "the masses of a cell sum to 1, m(Omega) included"
                             : "the masses of a cell sum to 1 at most; the rest is m(Omega)");
  }
  return known;
}

std::int64_t patch_of(std::int64_t cell, int step) {
  const std::int64_t patch = cell >> step;
  if (patch < std::numeric_limits<std::int32_t>::min() || patch > std::numeric_limits<std::int32_t>::max()) {
    throw Error(ErrorCode::kLimit, "an array lies outside all patch indices")
        .hint("'first_cell' counts cells of the array's step from the datum");
  }
  return patch;
}

PatchIndex patch_at(const CellArray& array, std::int64_t column, std::int64_t row) {
  return {static_cast<std::int32_t>(patch_of(array.meta.cell_x + column, array.meta.step)),
          static_cast<std::int32_t>(patch_of(array.meta.cell_y + row, array.meta.step))};
}

std::vector<PatchIndex> patches_with_data(const CellArray& array) {
  PatchMarks marks({patch_at(array, 0, 0), patch_at(array, array.columns - 1, array.rows - 1)});
  for (std::int64_t row = 0; row < array.rows; ++row) {
    for (std::int64_t column = 0; column < array.columns; ++column) {
      if (!is_known(array, row * array.columns + column)) continue;
      const PatchIndex patch = patch_at(array, column, row);
      marks.mark({patch, patch});
    }
  }
  auto patches = marks.marked();
  std::ranges::sort(patches);
  return patches;
}

}  // namespace

ArraySource::ArraySource(MapHeader header, std::vector<CellArray> arrays) {
  header_ = std::move(header);
  std::vector<PatchIndex> all;
  for (CellArray& array : arrays) {
    Part part;
    part.type = *header_.types.find(array.meta.type.name);
    part.patches = patches_with_data(array);
    part.cells = std::move(array);
    all.insert(all.end(), part.patches.begin(), part.patches.end());
    parts_.push_back(std::move(part));
  }
  std::ranges::stable_sort(parts_, {}, &Part::type);
  for (std::size_t i = 1; i < parts_.size(); ++i) {
    for (std::size_t j = i; j-- > 0 && parts_[j].type == parts_[i].type;) {
      std::vector<PatchIndex> both;
      std::ranges::set_intersection(parts_[i].patches, parts_[j].patches, std::back_inserter(both));
      if (both.empty()) continue;
      throw Error(ErrorCode::kDamaged, "arrays '" + printable(parts_[j].cells.meta.array) + "' and '" +
                                           printable(parts_[i].cells.meta.array) + "' both hold patch (" +
                                           std::to_string(both[0].x) + "," + std::to_string(both[0].y) +
                                           ") of layer '" + parts_[i].cells.meta.type.name + "'")
          .hint("each patch of a layer stands in one array: cut them along the patches");
    }
  }
  std::ranges::sort(all);
  all.erase(std::unique(all.begin(), all.end()), all.end());
  list(std::move(all));
}

void ArraySource::layers_of(PatchIndex patch, std::vector<LayerInfo>& out) const {
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    if (!std::ranges::binary_search(parts_[i].patches, patch)) continue;
    LayerInfo info;
    info.patch = patch;
    info.type = parts_[i].type;
    info.step = static_cast<std::uint8_t>(parts_[i].cells.meta.step);
    info.locator = i;
    out.push_back(info);
  }
}

void ArraySource::load(const LayerInfo& info, Layer& out) const {
  const CellArray& array = parts_[info.locator].cells;
  out.reset(array.meta.type, array.meta.step);
  const std::int64_t side = out.side();
  const std::int64_t x0 = info.patch.x * side - array.meta.cell_x,
                     y0 = info.patch.y * side - array.meta.cell_y;
  const std::int64_t left = std::max<std::int64_t>(x0, 0), right = std::min(x0 + side, array.columns);
  for (int c = 0; c < out.channels(); ++c) {
    const auto plane = out.plane(c);
    for (std::int64_t y = std::max<std::int64_t>(y0, 0); y < std::min(y0 + side, array.rows); ++y) {
      const auto from = array.values.begin() + (c * array.rows + y) * array.columns;
      std::copy(from + left, from + right, plane.begin() + (y - y0) * side + left - x0);
    }
  }
}

}  // namespace apgm::converters

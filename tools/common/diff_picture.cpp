#include "tools/common/diff_picture.hpp"

#include <array>
#include <utility>

#include "apgm/core/summary.hpp"

namespace apgm::tools {
namespace {

constexpr std::uint8_t kStateFree = CellDiff::kFirst + 1;  // of {O, F}

constexpr PlanePictureOptions kOptions{.min_side = 512, .min_patch_px = 16};

}  // namespace

DiffPicture::DiffPicture(const LayerType& type)
    : occupancy_(type.is_occupancy()), evidence_(type.is_evidence()), picture_(kOptions) {}

std::uint64_t DiffPicture::most_bytes(const PatchSource& reference, const PatchSource& other,
                                      const std::string& type) {
  PatchRange range;
  std::uint64_t cells = 0;
  int finest = 0;
  for (const PatchSource* source : {&reference, &other}) {
    const Summary summary = source->summary();
    range.add(summary.range);
    const auto id = source->header().types.find(type);
    if (!id) continue;
    for (int step = 0; step <= kMaxStep; ++step) {
      const std::uint64_t layers = summary.types[*id].layers_at[static_cast<std::size_t>(step)];
      cells += layers << (2 * step);
    }
    finest = std::max(finest, finest_step(summary.types[*id]).value_or(0));
  }
  return PlanePicture::most_bytes(kOptions, range, finest, cells);
}

void DiffPicture::put(PatchIndex patch, int step, std::span<const CellDiff> cells) {
  std::vector<std::uint8_t> looks;
  looks.reserve(cells.size());
  for (const CellDiff& cell : cells) looks.push_back(cell.differs ? change_of(cell) : look_of(cell));
  picture_.put(patch, step, std::move(looks));
}

/// A cell that did not change, or not in a way that has a colour, as it is now.
DiffPicture::Look DiffPicture::look_of(const CellDiff& cell) const {
  if (cell.after == CellDiff::kUnknown) return kUnknown;
  if (!occupancy_) return kUndecided;
  return cell.after == CellDiff::kUndecided ? kUndecided : cell.after == kStateFree ? kFree : kOccupied;
}

DiffPicture::Look DiffPicture::change_of(const CellDiff& cell) const {
  const auto occupied = [&](std::uint8_t state) { return !occupancy_ || state == CellDiff::kFirst; };
  if (cell.before == CellDiff::kUnknown) return occupied(cell.after) ? kLearned : kLearnedFree;
  if (cell.after == CellDiff::kUnknown) return occupied(cell.before) ? kForgotten : kForgottenFree;
  if (!evidence_) return kChanged;
  const bool decided = cell.before >= CellDiff::kFirst && cell.after >= CellDiff::kFirst;
  if (decided && cell.before != cell.after) {
    return !occupancy_ ? kChanged : cell.after == kStateFree ? kBecameFree : kBecameOccupied;
  }
  return cell.conflict >= kDrawnConflict ? kConflict : look_of(cell);
}

Colour DiffPicture::colour_of(Look look) {
  switch (look) {
    case kUnknown:
      return {224, 226, 230};
    case kFree:
      return {250, 250, 248};
    case kUndecided:
      return {196, 196, 196};
    case kOccupied:
      return {150, 150, 150};
    case kForgottenFree:
      return {250, 240, 150};
    case kForgotten:
      return {222, 186, 0};
    case kLearnedFree:
      return {184, 222, 246};
    case kLearned:
      return {86, 180, 233};
    case kConflict:
      return {0, 0, 0};
    case kBecameFree:
      return {0, 114, 178};
    case kBecameOccupied:
    case kChanged:
      return {213, 94, 0};
    case kLooks:
      break;
  }
  return {};
}

Rendering DiffPicture::rendering(const Frame& frame) const {
  std::array<Colour, kLooks> colours;
  for (std::size_t i = 0; i < colours.size(); ++i) colours[i] = colour_of(static_cast<Look>(i));
  Rendering out = picture_.rendering(frame, colours, colour_of(kUnknown));
  std::vector<std::pair<Look, const char*>> named;
  if (occupancy_) {
    named = {{kFree, "free in both"},           {kOccupied, "occupied in both"},
             {kUndecided, "undecided"},         {kBecameOccupied, "free -> occupied"},
             {kBecameFree, "occupied -> free"}, {kLearnedFree, "learned free"},
             {kLearned, "learned occupied"},    {kForgottenFree, "forgotten free"},
             {kForgotten, "forgotten occupied"}};
  } else {
    named = {{kUndecided, evidence_ ? "same class" : "unchanged"},
             {kChanged, evidence_ ? "class changed" : "changed"},
             {kLearned, "learned"},
             {kForgotten, "forgotten"}};
  }
  if (evidence_) named.emplace_back(kConflict, "conflict K >= 0.25");
  named.emplace_back(kUnknown, "unknown in both");
  for (const auto& [look, label] : named) out.legend.entries.push_back({label, colour_of(look)});
  return out;
}

}  // namespace apgm::tools

#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "apgm/core/source.hpp"

namespace apgm::ops {

/// Walks a source one patch ahead. The source outlives it.
class PatchLane {
 public:
  /// @param name  of the source, for messages
  PatchLane(const PatchSource& source, std::string name, const std::optional<PatchRange>& range = {});

  bool ended() const { return ended_; }
  /// Of the patch at hand.
  std::uint64_t key() const { return key_; }
  /// Gives the patch at hand and goes to the next.
  /// @throws Error{kDamaged} if the source's patches are not in key order
  void take(PatchInfo& out);

 private:
  void step();

  std::string name_;
  std::unique_ptr<PatchCursor> cursor_;
  PatchInfo ahead_;
  std::uint64_t key_ = 0;
  bool ended_ = false;
};

/// Walks two sources side by side: every patch that one of them holds, in key order.
class Lockstep {
 public:
  /// @param range  only patches in it
  Lockstep(const PatchSource& left, std::string left_name, const PatchSource& right, std::string right_name,
           const std::optional<PatchRange>& range = {})
      : left_lane_(left, std::move(left_name), range), right_lane_(right, std::move(right_name), range) {}

  /// Goes to the next patch, false at the end. @throws Error{kDamaged}
  bool next();
  PatchIndex patch() const { return has_left_ ? left_.patch : right_.patch; }
  /// Layers of the patch in each source, sorted by type; empty where it does not hold the patch.
  std::span<const LayerInfo> left() const { return has_left_ ? left_.layers : std::span<const LayerInfo>{}; }
  std::span<const LayerInfo> right() const {
    return has_right_ ? right_.layers : std::span<const LayerInfo>{};
  }

 private:
  PatchLane left_lane_, right_lane_;
  PatchInfo left_, right_;
  bool has_left_ = false, has_right_ = false;
};

/// The layer of `type` among the layers of a patch; nullptr if there is none.
const LayerInfo* find_layer(std::span<const LayerInfo> layers, TypeId type);

}  // namespace apgm::ops

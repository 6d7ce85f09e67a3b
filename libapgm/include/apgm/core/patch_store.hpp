#pragma once

#include "apgm/core/map.hpp"

namespace apgm {

/// Where patches rest that are not needed in memory now: each may come and go any number of times, in any
/// order. One thread at a time.
class PatchStore {
 public:
  virtual ~PatchStore() = default;
  /// The types that the layers of patches count in from now on. Layers that rest follow their type's name.
  /// @throws Error{kIncompatible} if a type that it holds layers of is missing, or of another space
  virtual void set_types(const TypeTable& types) = 0;
  /// Keeps the layers of `patch`, every bit of their cells (-0 becomes +0), stamps and error bounds too, in
  /// place of what it held at that index; layers without data are left out.
  /// @throws Error; what it held is then unchanged
  virtual void store(const Patch& patch) = 0;
  /// Gives the layers of `index` back as those of `out` and forgets them; false, `out` unchanged, if it has
  /// none.
  virtual bool take(PatchIndex index, Patch& out) = 0;
};

}  // namespace apgm

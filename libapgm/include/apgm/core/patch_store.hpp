#pragma once

#include "apgm/core/map.hpp"

namespace apgm {

/// Where patches rest that are not needed in memory now: each may come and go any number of times, in any
/// order. One thread at a time.
class PatchStore {
 public:
  virtual ~PatchStore() = default;
  /// Takes the layers of `patch`, every bit of their cells, stamps too; replaces what it held at its index.
  /// `patch` is left without layers, their memory may be kept for reuse.
  virtual void store(Patch& patch) = 0;
  /// Gives the layers of `index` back into `out` and forgets them; false, `out` unchanged, if it has none.
  virtual bool take(PatchIndex index, Patch& out) = 0;
};

}  // namespace apgm

#pragma once

#include "converters/common/converter.hpp"

namespace apgm::converters {

/// NumPy arrays: .npz with a meta.json in it, .npy with a .json beside it (docs/converters.md).
const Converter& numpy();

}  // namespace apgm::converters

#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace apgm::test {

/// SHA-256 (FIPS 180-4) in 64 hex digits: what expected results name cells by, since any language has it.
std::string sha256(std::span<const std::byte> bytes);

}  // namespace apgm::test

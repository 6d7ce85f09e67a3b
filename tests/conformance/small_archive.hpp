#pragma once

#include "small_map.hpp"

namespace apgm::test {

/// The small map.
inline ArchiveParts one_commit() {
  ArchiveParts archive;
  append_commit(archive, small_map());
  return archive;
}

/// Parts of a commit that changes the first layer and shares the others.
inline Parts small_change(const ArchiveParts& archive, float mass = 0.75f) {
  Parts parts = small_map();
  parts.layers[0] = stored_constant({0, 0}, 0, 1, {bits(mass), 0});
  for (const std::size_t i : {1u, 2u}) parts.layers[i] = archive.shared(i);
  return parts;
}

inline ArchiveParts two_commits(const Hooks& hooks = {}) {
  ArchiveParts archive = one_commit();
  append_commit(archive, small_change(archive), hooks);
  return archive;
}

/// Lets `bytes` in before the first block of `kind`.
inline Hooks with_before(std::uint8_t kind, std::string bytes) {
  Hooks hooks;
  hooks.before = [=, done = false](std::uint8_t at) mutable {
    const bool here = at == kind && !done;
    done = done || here;
    return here ? bytes : std::string();
  };
  return hooks;
}

inline void flip(std::string& bytes, std::size_t at) { bytes[at] = static_cast<char>(bytes[at] ^ 1); }

}  // namespace apgm::test

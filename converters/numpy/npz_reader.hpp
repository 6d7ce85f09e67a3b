#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "converters/numpy/npy.hpp"

namespace apgm::converters {

/// The entries of an .npz archive, stored or deflated, read through libzip, which checks their checksums.
class NpzReader {
 public:
  /// @throws Error{kUnreadable|kForeign}
  explicit NpzReader(const std::string& path);
  ~NpzReader();
  NpzReader(const NpzReader&) = delete;
  NpzReader& operator=(const NpzReader&) = delete;

  bool has(const std::string& name) const;
  /// @throws Error{kDamaged} if it is missing or fails its checksum, {kLimit} beyond `max_bytes`
  std::string text(const std::string& name, std::uint64_t max_bytes) const;
  /// @throws Error as read_npy, and {kDamaged} as text
  std::vector<float> array(const std::string& name, std::uint64_t max_bytes, NpyHeader& header,
                           std::uint64_t& rounded) const;

 private:
  class Entry;
  struct State;
  std::string path_;
  std::unique_ptr<State> state_;
};

}  // namespace apgm::converters

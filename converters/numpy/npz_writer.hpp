#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "apgm/format/output_file.hpp"

namespace apgm::converters {

/// Writes a ZIP archive as numpy.savez does, entry after entry, to a file that only grows: sizes and
/// checksums follow the data. Same calls, same bytes: all entries carry ZIP's first date.
class NpzWriter {
 public:
  NpzWriter(OutputFile& file, bool compressed);
  ~NpzWriter();

  void begin(const std::string& name);
  /// @throws Error{kOutput}, {kLimit} beyond 4 GiB
  void write(std::span<const std::byte> bytes);
  void end();
  /// The directory, after the last entry.
  void finish();

 private:
  struct Entry;
  struct Deflater;
  void emit(const std::string& bytes);
  void check_size(std::uint64_t bytes) const;

  OutputFile& file_;
  bool compressed_;
  std::uint64_t start_ = 0;
  std::vector<Entry> entries_;
  std::unique_ptr<Deflater> deflater_;
};

}  // namespace apgm::converters

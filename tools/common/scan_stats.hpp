#pragma once

#include <cstdint>
#include <string>

#include "apgm/core/layer_type.hpp"
#include "apgm/format/output_file.hpp"
#include "apgm/observe/mapper.hpp"

namespace apgm::tools {

/// A CSV file with a row for each measurement and layer: what a Mapper held after it, and what it cost.
class ScanStats {
 public:
  /// @throws Error{kOutput}
  ScanStats(const std::string& path, const OutputOptions& options);
  /// @param time_s  since the first measurement
  /// @param moved   report of the move before the measurement
  /// @param added   report of the measurement
  void add(std::uint64_t scan, double time_s, const TypeTable& types, const MapperReport& moved,
           const MapperReport& added);
  /// As OutputFile.
  void flush();
  void commit();

 private:
  void write();

  OutputFile file_;
  std::string rows_;
};

}  // namespace apgm::tools

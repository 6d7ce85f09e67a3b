#include "tools/common/scan_stats.hpp"

#include <fmt/format.h>

namespace apgm::tools {
namespace {

constexpr std::size_t kBlock = 1 << 16;
constexpr const char* kHeading =
    "scan,time_s,layer,patches,layers,cells,bytes,cells_fused,observe_ms,fuse_ms\n";

/// A name as CSV holds it.
std::string quoted(const std::string& name) {
  if (name.find_first_of(",\"") == std::string::npos) return name;
  std::string text = "\"";
  for (const char c : name) text += c == '"' ? std::string("\"\"") : std::string(1, c);
  return text + "\"";
}

}  // namespace

ScanStats::ScanStats(const std::string& path, const OutputOptions& options) : file_(path, options) {
  file_.write(std::string(kHeading));
}

void ScanStats::add(std::uint64_t scan, double time_s, const TypeTable& types, const MapperReport& moved,
                    const MapperReport& added) {
  for (std::size_t t = 0; t < added.types.size(); ++t) {
    const MapperReport::OfType& now = added.types[t];
    const MapperReport::OfType before = t < moved.types.size() ? moved.types[t] : MapperReport::OfType{};
    if (now.layers == 0 && now.cells_fused == 0) continue;
    rows_ += fmt::format("{},{:.3f},{},{},{},{},{},{},{:.3f},{:.3f}\n", scan, time_s,
                         quoted(types[static_cast<TypeId>(t)].name), added.patches, now.layers, now.cells,
                         now.bytes, now.cells_fused, 1e3 * (before.observe_s + now.observe_s),
                         1e3 * (before.fuse_s + now.fuse_s));
  }
  if (rows_.size() > kBlock) write();
}

void ScanStats::flush() {
  write();
  file_.flush();
}

void ScanStats::commit() { file_.commit(); }

void ScanStats::write() {
  file_.write(rows_);
  rows_.clear();
}

}  // namespace apgm::tools

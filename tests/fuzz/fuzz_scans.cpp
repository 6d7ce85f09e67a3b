// Recordings: read to their end. Built once a format, APGM_FUZZ_FORMAT; a second part of an input (parts_of)
// is the file of poses.

#include "converters/scans/scan_reader.hpp"
#include "fuzz.hpp"

namespace {

constexpr int kMostScans = 10'000;

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace apgm;
  const auto parts = fuzz::parts_of(fuzz::text_of(data, size));
  converters::ScanRequest request;
  request.format = APGM_FUZZ_FORMAT;
  request.paths = {fuzz::put("input", parts[0])};
  // A list names the clouds beside it.
  if (parts.size() > 1 && request.format == "cloud_list") fuzz::put("a.csv", parts[1]);
  if (parts.size() > 1 && request.format != "cloud_list") request.poses = fuzz::put("poses", parts[1]);
  fuzz::survives([&] {
    const auto scans = converters::open_scans(request);
    converters::Measurement measurement;
    for (int n = 0; n < kMostScans && scans->next(measurement);) ++n;
    for (const auto& fault : scans->faults()) fuzz::check_text(fault.text);
  });
  return 0;
}

// A foreign format as a source: opened, walked, loaded. Built once a format, APGM_FUZZ_FORMAT. An input may
// hold several files (parts_of), named by APGM_FUZZ_FILES. Its size chooses among settings.

#include <string_view>

#include "converters/common/converter.hpp"
#include "fuzz.hpp"

namespace {

using apgm::converters::Settings;

// A layout of cells is as large as its description says, up to the budget.
constexpr std::uint64_t kMaxMemory =
    std::string_view(APGM_FUZZ_FORMAT) == "fixed_grid" ? std::uint64_t{2} << 20 : std::uint64_t{64} << 20;

const std::vector<std::string>& names() {
  static const std::vector<std::string> list{APGM_FUZZ_FILES};
  return list;
}

const std::vector<Settings>& choices(std::string_view format) {
  static const std::vector<Settings> plain{{}};
  static const std::vector<Settings> octomap{{}, {{"mode", "slices"}}};
  static const std::vector<Settings> map_server{
      {}, {{"mode", "scale"}}, {{"mode", "raw"}}, {{"edge_m", "3.3"}}};
  return format == "octomap" ? octomap : format == "map_server" ? map_server : plain;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace apgm;
  const auto parts = fuzz::parts_of(fuzz::text_of(data, size));
  for (std::size_t i = 1; i < names().size(); ++i) {
    fuzz::put(names()[i], i < parts.size() ? parts[i] : std::string_view{});
  }
  converters::ReadRequest request;
  request.path = fuzz::put(names()[0], names().size() == 1 ? fuzz::text_of(data, size) : parts[0]);
  const auto& settings = choices(APGM_FUZZ_FORMAT);
  request.settings = settings[size % settings.size()];
  request.findings = [](const Finding& finding) { fuzz::check_text(finding.text); };
  request.max_memory_bytes = kMaxMemory;
  const converters::Converter* converter = converters::find(APGM_FUZZ_FORMAT);
  fuzz::survives([&] { fuzz::walk(*converter->open(request)); });
  return 0;
}

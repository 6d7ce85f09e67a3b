#include "fuzz.hpp"

#include <cstdio>
#include <cstdlib>

namespace apgm::fuzz {
namespace {

constexpr std::uint64_t kMostPatches = 8192;
constexpr std::uint64_t kMostBytes = std::uint64_t{32} << 20;
constexpr std::string_view kDivider = "====\n";

}  // namespace

void fail(const std::string& what) {
  std::fprintf(stderr, "fuzz: %s\n", what.c_str());
  std::abort();
}

void check_text(const std::string& text) {
  if (text.empty()) fail("an error without a message");
}

void walk(const PatchSource& source) {
  const TypeTable& types = source.header().types;
  const auto cursor = source.patches();
  PatchInfo patch;
  Layer layer;
  StoredLayer stored;
  std::uint64_t bytes = 0;
  for (std::uint64_t n = 0; n < kMostPatches && cursor->next(patch); ++n) {
    for (const LayerInfo& info : patch.layers) {
      if (info.type >= types.size()) fail("a layer is of a type that is not there");
      bytes += (std::uint64_t{4} << (2 * info.step)) * types[info.type].channels.size();
      if (bytes > kMostBytes) return;
      source.load(info, layer);
      if (layer.step() != info.step) fail("a layer has another step than was said");
      if (source.load_stored(info, stored) && stored.step != info.step)
        fail("a stored layer has another step");
    }
  }
}

std::vector<std::string_view> parts_of(std::string_view input) {
  std::vector<std::string_view> parts;
  for (;;) {
    const auto end = input.find(kDivider);
    parts.push_back(input.substr(0, end));
    if (end == std::string_view::npos) return parts;
    input.remove_prefix(end + kDivider.size());
  }
}

const test::TempDir& directory() {
  static const test::TempDir directory;
  return directory;
}

std::string put(const std::string& name, std::string_view bytes) {
  const std::string path = directory() / name;
  test::write_file(path, std::string(bytes));
  return path;
}

}  // namespace apgm::fuzz

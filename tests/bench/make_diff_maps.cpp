// Writes two maps of many small layers that differ in a few, for the benchmark of apgm-diff.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"
#include "samples/support/program.hpp"

namespace {

using namespace apgm;

constexpr const char* kUsage =
    "usage: make-diff-maps [--side N] [--differ K] [-O] A.apgm B.apgm\n"
    "\n"
    "  --side N     patches along a side, one layer of 8 x 8 cells each (default 1000)\n"
    "  --differ K   layers that differ (default 10)\n"
    "  -O           replace existing files\n";

/// N x N patches of one occupancy layer, made when they are loaded; every `every`-th has another first cell
/// if `edited`.
class Field final : public PatchSource {
 public:
  Field(int side, std::uint64_t differ, bool edited) : edited_(edited) {
    header_.types = TypeTable({LayerType::occupancy()});
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) patches_.push_back({x, y});
    }
    std::ranges::sort(patches_, {}, curve_key);
    every_ = std::max<std::uint64_t>(1, patches_.size() / std::max<std::uint64_t>(1, differ));
    count_ = differ;
  }

  const MapHeader& header() const override { return header_; }
  Summary summary() const override {
    Summary s;
    s.patches = patches_.size();
    for (const PatchIndex p : patches_) s.range.add(p);
    s.types.resize(1);
    s.types[0].layers = s.types[0].layers_at[kStep] = patches_.size();
    return s;
  }
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>&) const override {
    return std::make_unique<Cursor>(*this);
  }
  void load(const LayerInfo& info, Layer& out) const override {
    out.reset(header_.types[0], info.step);
    for (std::size_t i = 0; i < out.cells(); ++i) {
      // Any hash of patch and cell.
      const auto x = static_cast<std::uint64_t>(info.patch.x) * 2654435761u;
      const auto y = static_cast<std::uint64_t>(info.patch.y) * 40503u;
      const auto bits = static_cast<std::uint32_t>(((x ^ y) + i * 97) >> 3) & 255u;
      out.plane(bits & 1)[i] = static_cast<float>(bits | 1) / 512.0f;
    }
    if (!edited_ || info.locator % every_ != 0 || info.locator / every_ >= count_) return;
    out.plane(0)[0] = 0.75f;
    out.plane(1)[0] = 0.0f;
  }

 private:
  static constexpr std::uint8_t kStep = 3;
  class Cursor final : public PatchCursor {
   public:
    explicit Cursor(const Field& field) : field_(field) {}
    bool next(PatchInfo& out) override {
      if (at_ == field_.patches_.size()) return false;
      LayerInfo info;
      info.patch = out.patch = field_.patches_[at_];
      info.step = kStep;
      info.locator = at_++;
      out.layers.assign(1, info);
      return true;
    }

   private:
    const Field& field_;
    std::uint64_t at_ = 0;
  };

  MapHeader header_;
  std::vector<PatchIndex> patches_;  // in key order
  std::uint64_t every_ = 1, count_ = 0;
  bool edited_;
};

std::uint64_t number(std::vector<std::string>& args, const std::string& flag, std::uint64_t fallback) {
  const std::string text = samples::take_option(args, flag);
  if (text.empty()) return fallback;
  char* end = nullptr;
  const auto value = std::strtoull(text.c_str(), &end, 10);
  if (*end != '\0' || value < 1 || value > 10'000'000) {
    throw samples::UsageError{"'" + text + "' is not a value for " + flag};
  }
  return value;
}

void make_maps(std::vector<std::string> args) {
  const auto side = static_cast<int>(std::min<std::uint64_t>(number(args, "--side", 1000), 4000));
  const std::uint64_t differ = number(args, "--differ", 10);
  WriterOptions writing;
  writing.output.overwrite = samples::take_switch(args, "-O");
  samples::expect_arguments(args, 2);
  for (const bool edited : {false, true}) {
    const Field field(side, differ, edited);
    Writer writer(args[edited ? 1 : 0], field.header(), writing);
    copy(field, field.header().types, writer, /*reencode=*/false);
    writer.finish();
    std::printf("layers %llu bytes %llu\n", static_cast<unsigned long long>(writer.report().layers),
                static_cast<unsigned long long>(writer.report().file_bytes));
  }
}

}  // namespace

int main(int argc, char** argv) {
  return samples::run_program("make-diff-maps", kUsage, argc, argv, make_maps);
}

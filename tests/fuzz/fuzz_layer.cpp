// The body of a layer in each encoding. First byte: encoding; second: step; third: type; then the body.
// What is decoded is encoded, and decodes to the same cells.

#include <zstd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <random>

#include "apgm/core/layer.hpp"
#include "codec.hpp"
#include "fuzz.hpp"

namespace {

using namespace apgm;
using format::Encoding;

constexpr int kMostStep = 8;
constexpr std::size_t kHead = 3;
constexpr std::size_t kMostContent = std::size_t{1} << 20;

struct Choice {
  explicit Choice(const std::uint8_t* head)
      : encoding(static_cast<Encoding>(head[0] % (format::kLastEncoding + 2))),
        step(head[1] % (kMostStep + 1)),
        type(types()[head[2] % types().size()]) {}

  static const std::array<LayerType, 4>& types() {
    static const std::array<LayerType, 4> list{
        LayerType::occupancy(), LayerType::semantic("semantic", {"a", "b", "c"}),
        LayerType::real("velocity", {"vx", "vy"}), LayerType::real("count", {"n"}, Policy::kSum)};
    return list;
  }

  Encoding encoding;
  int step;
  const LayerType& type;
};

/// Changes what the zstd frame of a body unpacks to, and makes the body fit. Changed at random, a frame would
/// not unpack at all. Returns nothing where there is no whole frame.
std::vector<std::byte> mutate_frame(const Choice& choice, std::span<const std::byte> input) {
  const bool palette = choice.encoding == Encoding::kPalette;
  const std::size_t at = kHead + (palette ? 4 : 4 * choice.type.channels.size() + 8);
  if (choice.encoding == Encoding::kConstant || input.size() <= at) return {};
  const auto rest = input.subspan(at);
  const std::size_t frame = ZSTD_findFrameCompressedSize(rest.data(), rest.size());
  const auto size = ZSTD_getFrameContentSize(rest.data(), rest.size());
  if (ZSTD_isError(frame) || size == 0 || size > kMostContent) return {};
  std::vector<std::uint8_t> content(size);
  if (ZSTD_isError(ZSTD_decompress(content.data(), size, rest.data(), frame))) return {};
  LLVMFuzzerMutate(content.data(), size, size);
  std::vector<std::byte> out(input.begin(), input.begin() + static_cast<std::ptrdiff_t>(at));
  const auto bytes =
      static_cast<std::uint32_t>(format::append_frame(out, std::as_bytes(std::span(content)), 1));
  if (!palette) std::memcpy(&out[at - 4], &bytes, 4);
  out.insert(out.end(), rest.begin() + static_cast<std::ptrdiff_t>(frame), rest.end());
  return out;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < kHead) return 0;
  const Choice choice(data);
  Layer layer, again;
  const auto body = fuzz::bytes_of(data, size).subspan(kHead);
  if (!fuzz::survives([&] { format::decode(choice.encoding, choice.step, body, choice.type, layer); }))
    return 0;
  StoredLayer stored;
  format::encode(layer, choice.type, 1, Lossy::kNone, stored);
  format::decode(static_cast<Encoding>(stored.encoding), choice.step, stored.bytes, choice.type, again);
  if (!same_cells(layer, again)) fuzz::fail("a layer came back otherwise");
  return 0;
}

/// For libFuzzer: the name and the types are its own.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  if (size < kHead || std::minstd_rand(seed)() % 2 == 0) return LLVMFuzzerMutate(data, size, max_size);
  const auto out = mutate_frame(Choice(data), fuzz::bytes_of(data, size));
  if (out.empty() || out.size() > max_size) return LLVMFuzzerMutate(data, size, max_size);
  std::memcpy(data, out.data(), out.size());
  return out.size();
}

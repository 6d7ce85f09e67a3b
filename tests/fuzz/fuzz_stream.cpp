// A stream as it arrives: in one piece, byte by byte, in pieces, as datagrams; by the input's size. Nothing
// that arrives makes the receiver throw.

#include "apgm/format/stream.hpp"

#include <algorithm>

#include "fuzz.hpp"

namespace {

using namespace apgm;

constexpr std::string_view kSync = "APGMBLK1";

/// Decodes what arrives; of each layer and its going nothing older may come after something newer.
class Receiver final : public StreamHandler {
 public:
  void layer(const StreamLayer& layer) override {
    check(layer.header, layer.info.patch, layer.info.type, layer.number);
    fuzz::survives([&] { decode(layer, cells_); });
  }
  void gone(const StreamGone& gone) override { check(gone.header, gone.patch, gone.type, gone.number); }
  void end(const StreamEnd& end) override {
    if (end.first > end.number) fuzz::fail("a message ends before it begins");
  }

 private:
  void check(const MapHeader& header, PatchIndex patch, TypeId type, std::uint64_t number) {
    if (type >= header.types.size()) fuzz::fail("a layer is of a type that is not there");
    auto& newest = newest_[{patch, header.types[type].name}];
    if (number < newest) fuzz::fail("an older state came after a newer one");
    newest = number;
  }

  std::map<std::pair<PatchIndex, std::string>, std::uint64_t> newest_;
  Layer cells_;
};

void feed_datagrams(StreamReader& reader, std::string_view input) {
  while (!input.empty()) {
    const auto end = std::min(input.find(kSync, 1), input.size());
    reader.datagram(std::as_bytes(std::span(input.substr(0, end))));
    input.remove_prefix(end);
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = fuzz::bytes_of(data, size);
  Receiver receiver;
  StreamReader reader(receiver, {.max_block_bytes = 1 << 20, .max_kept_bytes = 4 << 20});
  const std::size_t way = size / 8 % 4;
  if (way == 3) {
    feed_datagrams(reader, fuzz::text_of(data, size));
  } else {
    const std::size_t piece = way == 0 ? std::max<std::size_t>(size, 1) : way == 1 ? 1 : 77;
    for (std::size_t at = 0; at < size; at += piece)
      reader.feed(bytes.subspan(at, std::min(piece, size - at)));
  }
  reader.finish();
  const StreamReport report = reader.report();
  if (report.complete() && report.damaged + report.lost + report.incomplete > 0)
    fuzz::fail("a loss is not told");
  return 0;
}

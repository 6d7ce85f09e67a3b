#include "apgm/format/writer.hpp"

#include <cassert>

#include "apgm/core/error.hpp"
#include "commit_writer.hpp"
#include "layer_block.hpp"
#include "output_blocks.hpp"
#include "preamble.hpp"

namespace apgm {

using namespace format;

struct Writer::State {
  State(const MapHeader& header, const WriterOptions& writer_options)
      : types(header.types), options(writer_options), commit(output, 1, header) {}

  TypeTable types;
  WriterOptions options;
  OutputBlocks output;
  CommitWriter commit;
  WriteReport report;
  bool any = false;
  std::uint64_t last_key = 0;
};

Writer::Writer(const std::string& path, const MapHeader& header, const WriterOptions& options) {
  start(header, options, [&] { return OutputFile(path, options.output); });
}

Writer::Writer(std::vector<std::byte>& bytes, const MapHeader& header, const WriterOptions& options) {
  start(header, options, [&] { return OutputFile(bytes); });
}

void Writer::start(const MapHeader& header, const WriterOptions& options,
                   const std::function<OutputFile()>& open) {
  check_level(options.level);
  state_ = std::make_unique<State>(header, options);
  state_->output.file.emplace(open());  // after the header was found fit: a bad one leaves no trace
  state_->output.write(bytes_of(make_preamble(false)));
  state_->commit.write_header();
}

Writer::~Writer() = default;

bool Writer::takes_stored() const { return state_->options.lossy == Lossy::kNone; }

void Writer::pack(Parcel& parcel) const {
  pack_layer(parcel, state_->types[parcel.type], state_->options.level, state_->options.lossy);
}

std::uint64_t Writer::working_bytes(std::uint64_t layer_bytes) const {
  return pack_memory(layer_bytes, state_->options.level);
}

void Writer::put(PatchIndex index, std::span<Parcel> parcels) {
  State& s = *state_;
  const std::uint64_t key = curve_key(index);
  assert(!s.any || key > s.last_key);
  s.any = true;
  s.last_key = key;
  for (const Parcel& parcel : parcels) {
    if (parcel.state == Parcel::State::kNothing) continue;
    assert(parcel.state == Parcel::State::kStored && parcel.patch == index);
    s.commit.add(parcel);
  }
}

void Writer::finish() {
  State& s = *state_;
  const Footer footer = s.commit.finish();
  s.output.write(footer_block(footer));
  s.report = {to_hex(footer.content_id), footer.file_bytes, footer.patches, footer.layers};
  s.output.file->commit();
}

const WriteReport& Writer::report() const { return state_->report; }

}  // namespace apgm

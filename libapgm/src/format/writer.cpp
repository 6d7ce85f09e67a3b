#include "apgm/format/writer.hpp"

#include <cassert>
#include <limits>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm_generated.h"
#include "codec.hpp"
#include "content_id.hpp"
#include "index.hpp"
#include "map_header.hpp"

namespace apgm {

using namespace format;

struct Writer::State {
  State(OutputFile output, const MapHeader& map_header, const WriterOptions& writer_options)
      : header(map_header), options(writer_options), file(std::move(output)), id(map_header) {}

  MapHeader header;
  WriterOptions options;
  OutputFile file;
  ContentId id;
  WriteReport report;
  BlockHeader header_block;
  std::uint64_t header_bytes = 0;
  std::vector<IndexEntry> page;
  std::vector<fbs::PageRef> pages;
  Summary summary;
  bool any = false;
  std::uint64_t last_key = 0;
  std::vector<std::byte> block;
  flatbuffers::FlatBufferBuilder fb{256};

  void write_block() {
    file.write(block);
    block.clear();
  }

  void flush_page() {
    if (page.empty()) return;
    pages.push_back(append_page(block, file.size(), page));
    if (pages.size() > kMaxPages) throw Error(ErrorCode::kLimit, "a file holds at most 2^30 layers");
    write_block();
    page.clear();
  }

  void put_layer(std::uint64_t key, const Parcel& parcel) {
    const StoredLayer& stored = parcel.stored;
    fb.Clear();
    fb.Finish(fbs::CreateLayer(fb, parcel.patch.x, parcel.patch.y, parcel.type, stored.step, stored.encoding,
                               parcel.stamp_ns, stored.content_hash, stored.error_bound));
    const std::uint64_t offset = file.size();
    const BlockHeader h =
        append_block(block, Kind::kLayer, key, std::as_bytes(std::span(fb.GetBufferPointer(), fb.GetSize())),
                     stored.bytes);
    const std::size_t bytes = block.size();
    write_block();
    page.push_back({key, offset, stored.content_hash, h.payload_hash, parcel.stamp_ns, parcel.patch.x,
                    parcel.patch.y, static_cast<std::uint32_t>(bytes), parcel.type, stored.step,
                    stored.encoding, 0});
    id.add(parcel.patch, parcel.type, stored.step, stored.content_hash);
    Summary::OfType& totals = summary.types[parcel.type];
    ++totals.layers;
    ++totals.layers_at[stored.step];
    totals.stored_bytes += bytes;
    totals.raw_bytes += (std::uint64_t{4} << (2 * stored.step)) * header.types[parcel.type].channels.size();
    ++report.layers;
    if (page.size() == kPageEntriesWritten) flush_page();
  }
};

Writer::Writer(const std::string& path, const MapHeader& header, const WriterOptions& options) {
  start(header, options, [&] { return OutputFile(path, options.output); });
}

Writer::Writer(std::vector<std::byte>& bytes, const MapHeader& header, const WriterOptions& options) {
  start(header, options, [&] { return OutputFile(bytes); });
}

void Writer::start(const MapHeader& header, const WriterOptions& options,
                   const std::function<OutputFile()>& open) {
  if (options.level < 1 || options.level > 19) {
    throw Error(ErrorCode::kInvalidArgument, "a compression level lies in 1..19");
  }
  std::vector<std::byte> start(sizeof(Preamble));
  const BlockHeader h = append_map_header(start, header);  // before the file: a bad header leaves no trace
  Preamble preamble;
  preamble.hash = hash_of(bytes_of(preamble).first(offsetof(Preamble, hash)));
  std::memcpy(start.data(), &preamble, sizeof(preamble));
  state_ = std::make_unique<State>(open(), header, options);
  state_->header_block = h;
  state_->header_bytes = start.size() - sizeof(Preamble);
  state_->summary.types.resize(header.types.size());
  state_->file.write(start);
}

Writer::~Writer() = default;

bool Writer::takes_stored() const { return state_->options.lossy == Lossy::kNone; }

void Writer::pack(Parcel& parcel) const {
  const LayerType& type = state_->header.types[parcel.type];
  const Lossy lossy = state_->options.lossy;
  if (parcel.state != Parcel::State::kCells) return;
  canonicalise(parcel.cells, type);
  quantise(parcel.cells, type, lossy);
  if (is_vacuous(parcel.cells, type)) {
    parcel.state = Parcel::State::kNothing;
    return;
  }
  encode(parcel.cells, type, state_->options.level, lossy, parcel.stored);
  parcel.state = Parcel::State::kStored;
}

void Writer::put(PatchIndex index, std::span<Parcel> parcels) {
  State& s = *state_;
  const std::uint64_t key = curve_key(index);
  assert(!s.any || key > s.last_key);
  s.any = true;
  s.last_key = key;
  bool has_layers = false;
  for (const Parcel& parcel : parcels) {
    if (parcel.state == Parcel::State::kNothing) continue;
    assert(parcel.state == Parcel::State::kStored && parcel.patch == index);
    s.put_layer(key, parcel);
    has_layers = true;
  }
  if (!has_layers) return;
  ++s.report.patches;
  s.summary.range.add(index);
}

void Writer::finish() {
  State& s = *state_;
  s.flush_page();
  const std::uint64_t root_offset = s.file.size();
  append_root(s.block, s.pages, s.summary.types);
  const auto root = read_as<BlockHeader>(s.block);
  const std::uint64_t root_bytes = s.block.size();
  s.write_block();

  Footer footer;
  footer.header_offset = sizeof(Preamble);
  footer.header_bytes = s.header_bytes;
  footer.header_hash = s.header_block.payload_hash;
  footer.root_offset = root_offset;
  footer.root_bytes = root_bytes;
  footer.root_hash = root.payload_hash;
  footer.patches = s.report.patches;
  footer.layers = s.report.layers;
  footer.content_id = s.id.value();
  footer.x_min = s.summary.range.min.x;
  footer.y_min = s.summary.range.min.y;
  footer.x_max = s.summary.range.max.x;
  footer.y_max = s.summary.range.max.y;
  footer.file_bytes = s.file.size() + kFooterBlockBytes;
  append_block(s.block, Kind::kFooter, 0, {}, bytes_of(footer));
  s.write_block();
  s.report.content_id = to_hex(footer.content_id);
  s.report.file_bytes = s.file.size();
  s.file.commit();
}

const WriteReport& Writer::report() const { return state_->report; }

}  // namespace apgm

#include "corpus.hpp"
#include "small_map.hpp"

namespace apgm::test {
namespace {

std::string later_minor_version() {
  Hooks hooks;
  hooks.preamble = [](Preamble& p) {
    p.minor = 7;
    p.ro_compat = 0x80000001;
    p.compat = 0xffffffff;
    p.reserved.fill('r');
  };
  return put_together(small_map(), hooks);
}

std::string small_pages() {
  Parts parts = small_map();
  parts.page_entries = 1;
  return put_together(parts);
}

std::string unknown_blocks() {
  Hooks hooks;
  hooks.before = [](std::uint8_t kind) {
    BlockHead head;
    head.kind = kind == kMapHeader ? 9 : 0x80;
    head.key = 77;
    // The header follows the preamble: nothing goes between.
    return kind == kMapHeader ? std::string() : make_block(head, "what nobody needs to know");
  };
  return put_together(small_map(), hooks);
}

std::string known_blocks_that_must_be_understood() {
  Hooks hooks;
  hooks.head = [](BlockHead& head) { head.flags = 1; };
  return put_together(small_map(), hooks);
}

/// Tables with a field of a version to come. The ids are far above those in use, so that they stay unknown.
std::string unknown_fields() {
  Hooks hooks;
  hooks.payload = [](BlockHead& head, std::string& payload) {
    if (head.kind != kLayer) return;
    const auto& old = *flatbuffers::GetRoot<fbs::Layer>(payload.data());
    flatbuffers::FlatBufferBuilder fb;
    const auto text = fb.CreateString("from a later version");
    const auto start = fb.StartTable();
    fb.AddElement<std::int32_t>(fbs::Layer::VT_IX, old.ix(), 0);
    fb.AddElement<std::int32_t>(fbs::Layer::VT_IY, old.iy(), 0);
    fb.AddElement<std::uint16_t>(fbs::Layer::VT_TYPE, old.type(), 0);
    fb.AddElement<std::uint8_t>(fbs::Layer::VT_STEP, old.step(), 0);
    fb.AddElement<std::uint8_t>(fbs::Layer::VT_ENCODING, old.encoding(), 0);
    fb.AddElement<std::uint64_t>(fbs::Layer::VT_CONTENT_HASH, old.content_hash(), 0);
    fb.AddOffset<flatbuffers::String>(4 + 2 * 40, text);
    fb.AddElement<std::uint64_t>(4 + 2 * 41, 1, 0);
    fb.Finish(flatbuffers::Offset<fbs::Layer>(fb.EndTable(start)));
    std::string flat(reinterpret_cast<const char*>(fb.GetBufferPointer()), fb.GetSize());
    flat.resize((flat.size() + 7) / 8 * 8);
    payload = flat + payload.substr(head.m);
    head.m = static_cast<std::uint32_t>(flat.size());
  };
  return put_together(small_map(), hooks);
}

/// Without any vector or string that need not be there.
std::string bare_header() {
  flatbuffers::FlatBufferBuilder fb;
  const auto frame_id = fb.CreateString("map");
  fbs::MapHeaderBuilder header(fb);
  header.add_edge_um(12'800'000);
  header.add_frame_id(frame_id);
  fb.Finish(header.Finish());
  Parts parts;
  parts.map_header.assign(reinterpret_cast<const char*>(fb.GetBufferPointer()), fb.GetSize());
  parts.map_header.resize((parts.map_header.size() + 7) / 8 * 8);
  return put_together(parts);
}

/// In no order, one twice, one without use.
std::string untidy_palette() {
  const std::uint32_t half = bits(0.5f), quarter = bits(0.25f), most = bits(0.75f);
  const Planes cells = small_cells();
  const Planes tuples{{0, most}, {half, 0}, {0, 0}, {half, quarter}, {0, quarter}, {0, 0}};
  return put_together(with_body(2, cells, palette_body(tuples, {1, 4, 5, 0})));
}

std::string masks_that_name_background() {
  const Planes cells = small_cells();
  Masked m;
  m.counts = {4, 4};
  m.masks = "\x0f\x0f";
  for (const auto& plane : cells) m.values.insert(m.values.end(), plane.begin(), plane.end());
  return put_together(with_body(1, cells, m.body()));
}

std::string narrow_real_values() {
  Parts parts = small_map();
  const LayerType& z = parts.header.types[1];
  Planes cells{{bits(z.background(0)), 0, bits(static_cast<float>(513) / 65535.0f), bits(1.0f)}};
  Masked m = masked(z, cells);
  m.width = 2;
  m.values = {0, 513, 65535};
  parts.layers[1] = stored({0, 0}, 1, 1, 3, cells, m.body());
  return put_together(parts);
}

std::string one_raw_plane() {
  const Planes cells{{bits(0.3f), 0, 0, 0}, {0, bits(0.1f), 0, bits(0.7f)}};
  return put_together(with_body(1, cells, masked(small_occupancy(), cells, 1).body()));
}

std::string frames_with_checksums() {
  const Planes cells = small_cells();
  const Masked m = masked(small_occupancy(), cells);
  return put_together(with_body(1, cells, m.body(zstd_frame_with_checksum(m.content()))));
}

std::string stated_error_bound() {
  Parts parts = small_map();
  parts.layers[0].error_bound = 1;
  parts.layers[2].error_bound = 0x1p-149f;
  return put_together(parts);
}

/// A type with the names of another's channels, twice the same, and no CRS.
std::string repeated_names() {
  Parts parts;
  parts.header.types = TypeTable({LayerType::real("a", {"v", "v"}), LayerType::real("b", {"v"})});
  parts.layers = {stored_constant({9, -9}, 0, 2, {bits(1), bits(-1)})};
  return put_together(parts);
}

}  // namespace

std::vector<GoodFile> foreign_made_files() {
  return {{"other_small", put_together(small_map())},
          {"other_minor_version", later_minor_version()},
          {"other_small_pages", small_pages()},
          {"other_unknown_blocks", unknown_blocks()},
          {"other_must_understand_known", known_blocks_that_must_be_understood()},
          {"other_unknown_fields", unknown_fields()},
          {"other_bare_header", bare_header()},
          {"other_untidy_palette", untidy_palette()},
          {"other_masks_name_background", masks_that_name_background()},
          {"other_narrow_real_values", narrow_real_values()},
          {"other_one_raw_plane", one_raw_plane()},
          {"other_frames_with_checksums", frames_with_checksums()},
          {"other_error_bounds", stated_error_bound()},
          {"other_repeated_names", repeated_names()}};
}

}  // namespace apgm::test

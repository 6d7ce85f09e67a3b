// Layer blocks: what they say of themselves, bodies, cells.

#include <limits>

#include "bad_files.hpp"
#include "small_map.hpp"

namespace apgm::test {
namespace {

std::string with_encoded(std::uint8_t encoding, const Planes& cells, std::string body) {
  return put_together(with_body(encoding, cells, std::move(body)));
}

/// FlatBuffer of the first layer, made again from changed fields.
struct Fields {
  std::int32_t ix, iy;
  std::uint16_t type;
  std::uint8_t step, encoding;
  std::int64_t stamp_ns;
  std::uint64_t content_hash;
  float error_bound;
};

std::string with_fields(const std::function<void(Fields&)>& change) {
  Hooks hooks;
  hooks.payload = [=, done = false](BlockHead& head, std::string& payload) mutable {
    if (head.kind != kLayer || done) return;
    done = true;
    const auto& l = *flatbuffers::GetRoot<fbs::Layer>(payload.data());
    Fields f{l.ix(),       l.iy(),       l.type(),         l.step(),
             l.encoding(), l.stamp_ns(), l.content_hash(), l.error_bound()};
    change(f);
    flatbuffers::FlatBufferBuilder fb;
    fb.Finish(fbs::CreateLayer(fb, f.ix, f.iy, f.type, f.step, f.encoding, f.stamp_ns, f.content_hash,
                               f.error_bound));
    std::string flat(reinterpret_cast<const char*>(fb.GetBufferPointer()), fb.GetSize());
    flat.resize((flat.size() + 7) / 8 * 8);
    payload = flat + payload.substr(head.m);
    head.m = static_cast<std::uint32_t>(flat.size());
  };
  return put_together(small_map(), hooks);
}

void add_fields(BadFiles& out) {
  const auto add = [&](const std::string& name, const std::function<void(Fields&)>& change) {
    out.add("layer_" + name, "damaged", "4: " + name + " of a layer", with_fields(change));
  };
  add("ix", [](Fields& f) { f.ix = 1; });
  add("iy", [](Fields& f) { f.iy = -1; });
  add("type", [](Fields& f) { f.type = 1; });
  add("step", [](Fields& f) { f.step = 2; });
  add("encoding", [](Fields& f) { f.encoding = 2; });
  add("stamp", [](Fields& f) { f.stamp_ns = 7; });
  add("content_hash", [](Fields& f) { f.content_hash ^= 1; });
  add("error_bound_negative", [](Fields& f) { f.error_bound = -0.5f; });
  add("error_bound_over_1", [](Fields& f) { f.error_bound = 1.5f; });
  add("error_bound_not_a_number", [](Fields& f) { f.error_bound = std::numeric_limits<float>::quiet_NaN(); });
  Hooks hooks;
  hooks.payload = [](BlockHead& head, std::string& payload) {
    if (head.kind != kLayer || head.key != curve_key({0, 1})) return;
    payload.insert(head.m, 4096, '\0');
    head.m += 4096;
  };
  out.add("layer_flatbuffer_too_large", "damaged", "4: the FlatBuffer takes at most 4096 bytes",
          put_together(small_map(), hooks));
  Parts parts = small_map();
  parts.layers[0].entry.content_hash ^= 1;
  out.add("layer_cells_of_another_hash", "damaged", "4: the cells have the content hash",
          put_together(parts));
}

void add_constants(BadFiles& out) {
  const Planes cells(2, std::vector<std::uint32_t>(4, bits(0.25f)));
  const std::string body = floats({bits(0.25f), bits(0.25f)});
  out.add("constant_cut", "damaged", "4: C float32", with_encoded(0, cells, body.substr(0, 4)));
  out.add("constant_too_long", "damaged", "4: C float32", with_encoded(0, cells, body + body));
  out.add("constant_empty", "damaged", "4: C float32", with_encoded(0, cells, ""));
}

void add_masked(BadFiles& out) {
  const Masked good = masked(small_occupancy(), small_cells());
  const auto add = [&](const std::string& name, const std::string& rule,
                       const std::function<std::string(Masked)>& body, std::uint8_t encoding = 1) {
    out.add("masked_" + name, "damaged", "4: " + rule, with_encoded(encoding, small_cells(), body(good)));
  };
  add("empty", "masked body", [](const Masked&) { return std::string(); });
  add("cut", "masked body", [](const Masked& m) { return m.body().substr(0, 12); });
  add("count", "number of values of each channel", [](Masked m) {
    std::swap(m.counts[0], m.counts[1]);
    return m.body();
  });
  add("count_too_many", "number of values of each channel", [](Masked m) {
    m.counts[0] = 5;
    return m.body();
  });
  add("count_huge", "number of values of each channel", [](Masked m) {
    m.counts = {0xffffffff, 0xffffffff};
    return m.body();
  });
  add("mask_bits_beyond", "bits beyond n are zero", [](Masked m) {
    m.masks[0] = static_cast<char>(m.masks[0] | 0x80);
    return m.body();
  });
  add("mask_bits_moved_beyond", "bits beyond n are zero", [](Masked m) {
    m.masks[0] = 0x10;
    return m.body();
  });
  add("three_raw_planes", "0..2 raw planes", [](Masked m) {
    m.raw_planes = 3;
    return m.body();
  });
  add("raw_planes_missing", "p raw byte planes", [](Masked m) {
    m.raw_planes = 1;
    std::string body = m.body();
    body.resize(body.size() - m.values.size());
    return body;
  });
  add("raw_planes_too_long", "p raw byte planes", [](Masked m) { return m.body() + "x"; });
  add("frame_size", "bytes of the frame", [](const Masked& m) {
    std::string body = m.body();
    body[12] = static_cast<char>(body[12] + 1);
    return body;
  });
  add("frame_empty", "exactly one zstd frame", [](const Masked& m) { return m.body(std::string()); });
  add("frame_magic", "exactly one zstd frame", [](const Masked& m) {
    std::string frame = zstd_frame(m.content());
    frame[0] = 'x';
    return m.body(frame);
  });
  add("frame_cut", "exactly one zstd frame", [](const Masked& m) {
    const std::string frame = zstd_frame(m.content());
    return m.body(frame.substr(0, frame.size() - 1));
  });
  add("frame_and_more", "bytes after a frame",
      [](const Masked& m) { return m.body(zstd_frame(m.content()) + "x"); });
  add("frame_and_skippable", "skippable frames",
      [](const Masked& m) { return m.body(zstd_frame(m.content()) + skippable_frame()); });
  add("skippable_and_frame", "skippable frames",
      [](const Masked& m) { return m.body(skippable_frame() + zstd_frame(m.content())); });
  add("two_frames", "several frames", [](const Masked& m) {
    const std::string content = m.content();
    return m.body(zstd_frame(content.substr(0, 4)) + zstd_frame(content.substr(4)));
  });
  add("frame_and_empty_frame", "several frames",
      [](const Masked& m) { return m.body(zstd_frame(m.content()) + zstd_frame("")); });
  add("frame_without_size", "a frame states its content size",
      [](const Masked& m) { return m.body(zstd_frame_without_size(m.content())); });
  add("frame_too_large", "content size of a frame",
      [](const Masked& m) { return m.body(zstd_frame(m.content() + '\0')); });
  add("frame_too_small", "content size of a frame", [](const Masked& m) {
    const std::string content = m.content();
    return m.body(zstd_frame(content.substr(0, content.size() - 1)));
  });
  add("frame_bomb", "content size of a frame",
      [](const Masked& m) { return m.body(zstd_frame(std::string(std::size_t{1} << 25, '\0'))); });
  add("frame_lies_about_size", "content size of a frame", [](const Masked& m) {
    // One more byte than is stated: the frame's size stands in its sixth byte.
    std::string frame = zstd_frame(m.content() + '\0');
    frame[5] = static_cast<char>(frame[5] - 1);
    return m.body(frame);
  });
  add("frame_block_broken", "exactly one zstd frame", [](const Masked& m) {
    std::string frame = zstd_frame(m.content());
    frame[6] = static_cast<char>(frame[6] | 6);
    return m.body(frame);
  });
  add("frame_checksum", "exactly one zstd frame", [](const Masked& m) {
    std::string frame = zstd_frame_with_checksum(m.content());
    frame.back() = static_cast<char>(frame.back() ^ 1);
    return m.body(frame);
  });
  const auto narrow = [](int width, std::uint32_t raw_planes) {
    return [=](Masked m) {
      m.width = width;
      m.raw_planes = raw_planes;
      m.values = {128, 64, 191};
      return m.body();
    };
  };
  add("16_with_raw_plane", "no raw planes but for w = 4", narrow(2, 1), 3);
  add("8_with_raw_plane", "no raw planes but for w = 4", narrow(1, 1), 4);
}

void add_palettes(BadFiles& out) {
  const std::uint32_t half = bits(0.5f), quarter = bits(0.25f), most = bits(0.75f);
  const Planes tuples{{0, 0}, {0, quarter}, {0, most}, {half, 0}};
  const std::vector<std::uint32_t> numbers{3, 1, 0, 2};
  const auto add = [&](const std::string& name, const std::string& rule, const std::string& body) {
    out.add("palette_" + name, "damaged", "4: " + rule, with_encoded(2, small_cells(), body));
  };
  const std::string content = palette_content(tuples, numbers), good = palette_body(tuples, numbers);
  add("empty", "u32 t", "");
  add("no_tuples", "1..4096 tuples", u32(0) + zstd_frame(std::string(4, '\0')));
  add("too_many_tuples", "1..4096 tuples", u32(4097) + good.substr(4));
  add("4097_tuples", "1..4096 tuples", palette_body(Planes(4097, {half, 0}), numbers));
  add("tuples_huge", "1..4096 tuples", u32(0xffffffff) + good.substr(4));
  add("fewer_tuples", "content size of a frame", u32(3) + good.substr(4));
  add("number_beyond", "numbers are below t", palette_body(tuples, {3, 1, 4, 2}));
  add("frame_missing", "exactly one zstd frame", u32(4));
  add("frame_and_more", "bytes after a frame", good + '\0');
  add("frame_too_small", "content size of a frame",
      u32(4) + zstd_frame(content.substr(0, content.size() - 1)));
  add("bomb", "content size of a frame", u32(4) + zstd_frame(std::string(std::size_t{1} << 25, '\0')));
  Planes many(300, {half, 0});
  many[0] = {0, 0};
  add("wide_number_beyond", "numbers are below t", palette_body(many, {300, 0, 0, 0}));
  add("narrow_numbers_for_300", "byte plane 1, then 0",
      u32(300) + zstd_frame(palette_content(many, numbers).substr(0, 300 * 8) + std::string(4, '\0')));
}

/// Cells against section 1, as palettes: those hold any bits.
void add_cells(BadFiles& out) {
  const auto masses = [&](const std::string& name, const std::string& rule, std::uint32_t o,
                          std::uint32_t f) {
    const Planes cells{{o, 0, 0, 0}, {f, 0, 0, bits(0.5f)}};
    const Planes tuples{{o, f}, {0, 0}, {0, bits(0.5f)}};
    out.add("mass_" + name, "damaged", "1: " + rule,
            with_encoded(2, cells, palette_body(tuples, {0, 1, 1, 2})));
  };
  const std::string range = "masses lie in [0, 1]";
  masses("negative", range, bits(-0.25f), 0);
  masses("over_1", range, 0x3f800001, 0);
  masses("minus_0", "-0 is not allowed", 0x80000000, 0);
  masses("not_a_number", range, 0x7fc00000, 0);
  masses("infinite", range, 0x7f800000, 0);
  masses("sum_over_1", "the sum is at most 1 + 1e-6", bits(0.75f), bits(0.5f));
  masses("sum_just_over_1", "the sum is at most 1 + 1e-6", bits(0.5f), 0x3f000012);

  const LayerType semantic = LayerType::semantic("semantic", {"a", "b"});
  const auto omega = [&](const std::string& name, std::uint32_t a, std::uint32_t omega_mass) {
    Parts parts;
    parts.header.types = TypeTable({semantic});
    const std::vector<std::uint32_t> tuple{a, 0, omega_mass};
    parts.layers = {stored_constant({0, 0}, 0, 1, tuple)};
    out.add("omega_" + name, "damaged", "1: with explicit Omega the sum is 1 +- 1e-6", put_together(parts));
  };
  omega("sum_too_small", bits(0.25f), bits(0.5f));
  omega("sum_just_too_small", bits(0.5f), 0x3effffdc);
  omega("sum_too_large", bits(0.5f), bits(0.75f));
  omega("nothing_known_but_no_omega", 0, 0);
  omega("no_data", 0, bits(1.0f));

  const auto values = [&](const std::string& name, const std::string& rule, const LayerType& type,
                          std::uint32_t value) {
    Parts parts;
    parts.header.types = TypeTable({type});
    parts.layers = {stored_constant({0, 0}, 0, 1, {value})};
    out.add("real_" + name, "damaged", "1: " + rule, put_together(parts));
  };
  const LayerType height = LayerType::real("height", {"z"}),
                  hits = LayerType::real("hits", {"n"}, Policy::kSum);
  values("infinite", "real values are finite", height, 0x7f800000);
  values("minus_infinite", "real values are finite", height, 0xff800000);
  values("minus_0", "-0 is not allowed", height, 0x80000000);
  values("negative_nan", "the quiet NaN 0x7fc00000", hits, 0xffc00000);
  values("signalling_nan", "the quiet NaN 0x7fc00000", hits, 0x7f800001);
  values("nan_with_payload", "the quiet NaN 0x7fc00000", hits, 0x7fc00001);
  values("no_data", "a layer in which every value is background", height, 0x7fc00000);
  values("no_counts", "a layer in which every value is background", hits, 0);
  out.add("mass_no_data", "damaged", "1: a layer in which every value is background",
          with_encoded(0, Planes(2, std::vector<std::uint32_t>(4, 0)), floats({0, 0})));
}

/// A layer of 80 MiB that takes 20 bytes.
void add_large(BadFiles& out) {
  Parts parts;
  parts.header.types = TypeTable({LayerType::real("values", {"a", "b", "c", "d", "e"})});
  StoredPart part;
  part.entry.step = 11;
  part.body = floats(std::vector<std::uint32_t>(5, bits(1.0f)));
  parts.layers = {part};
  out.add("layer_of_80_mib", "damaged", "4: a decoded layer holds at most 64 MiB", put_together(parts));
}

}  // namespace

void add_layers(BadFiles& out) {
  add_fields(out);
  add_constants(out);
  add_masked(out);
  add_palettes(out);
  add_cells(out);
  add_large(out);
}

}  // namespace apgm::test

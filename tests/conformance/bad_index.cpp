// Index pages and the index root.

#include <limits>

#include "bad_files.hpp"
#include "small_map.hpp"

namespace apgm::test {
namespace {

using Pages = std::vector<fbs::PageRef>;
using Totals = std::vector<fbs::TypeTotals>;

std::string with_root(const std::function<void(Pages&, Totals&)>& change, std::size_t page_entries = 1) {
  Parts parts = small_map();
  parts.page_entries = page_entries;
  Hooks hooks;
  hooks.root = change;
  return put_together(parts, hooks);
}

/// Entries of the one page.
std::string with_page(const std::function<void(std::vector<Entry>&)>& change) {
  Hooks hooks;
  hooks.page = change;
  return put_together(small_map(), hooks);
}

std::string with_page_payload(const std::function<void(BlockHead&, std::string&)>& change) {
  Hooks hooks;
  hooks.payload = [=](BlockHead& head, std::string& payload) {
    if (head.kind == kIndexPage) change(head, payload);
  };
  return put_together(small_map(), hooks);
}

/// A page with another frame.
std::string with_page_frame(const std::function<std::string(const std::string& frame)>& change) {
  return with_page_payload([=](BlockHead& head, std::string& payload) {
    payload = payload.substr(0, head.m) + change(payload.substr(head.m));
  });
}

fbs::PageRef edited(const fbs::PageRef& r, const std::function<void(std::array<std::uint64_t, 5>&)>& change,
                    std::int32_t x_max_more = 0, std::uint32_t entries_more = 0, std::uint32_t reserved = 0) {
  std::array<std::uint64_t, 5> f{r.offset(), r.bytes(), r.hash(), r.first_key(), r.last_key()};
  change(f);
  return {f[0],      f[1],
          f[2],      f[3],
          f[4],      r.x_min(),
          r.y_min(), r.x_max() + x_max_more,
          r.y_max(), r.entries() + entries_more,
          reserved};
}

fbs::TypeTotals totals_with(const fbs::TypeTotals& t, std::uint64_t layers, std::uint64_t stored,
                            std::uint64_t raw, std::size_t step_more = 12, std::size_t step_less = 12) {
  std::array<std::uint64_t, 12> at{};
  for (std::size_t i = 0; i < at.size(); ++i) {
    at[i] = t.layers_at()->Get(static_cast<flatbuffers::uoffset_t>(i)) + (i == step_more) - (i == step_less);
  }
  return {layers, stored, raw, flatbuffers::span<const std::uint64_t, 12>(at)};
}

void add_entries(BadFiles& out) {
  const auto add = [&](const std::string& name, const std::string& rule,
                       const std::function<void(std::vector<Entry>&)>& change,
                       const std::string& refused = "damaged") {
    out.add("entry_" + name, refused, "5: " + rule, with_page(change));
  };
  add("key", "keys fit their patches", [](auto& e) { e[2].key += 1; });
  add("patch", "keys fit their patches", [](auto& e) { e[0].ix += 1; });
  add("not_ascending", "entries ascend by (key, type)", [](auto& e) { std::swap(e[0], e[1]); });
  add("patches_not_ascending", "entries ascend by (key, type)", [](auto& e) { std::swap(e[0], e[2]); });
  add("offset_outside", "blocks lie in the file", [](auto& e) { e[0].offset = 1 << 20; });
  add("offset_wraps", "blocks lie in the file",
      [](auto& e) { e[0].offset = std::numeric_limits<std::uint64_t>::max() - 7; });
  add("offset_not_aligned", "blocks start at a multiple of 8", [](auto& e) { e[0].offset += 4; });
  add("offset_of_another", "blocks are those that are named", [](auto& e) { e[0].offset = e[2].offset; });
  add("block_of_another", "4: patch of the layer", [](auto& e) {
    e[0].offset = e[2].offset;
    e[0].payload_hash = e[2].payload_hash;
    e[0].content_hash = e[2].content_hash;
    e[0].bytes = e[2].bytes;
  });
  add("bytes", "bytes of the block", [](auto& e) { e[0].bytes += 8; });
  add("bytes_0", "bytes of the block", [](auto& e) { e[0].bytes = 0; });
  add("bytes_too_many", "no block is larger than its layer's values + 1/16 + 16 KiB",
      [](auto& e) { e[0].bytes = 0x7ffffff8; });
  out.add("entry_payload_hash", "damaged", "5: hash of the block's payload",
          with_page([](auto& e) { e[0].payload_hash ^= 1; }), true);
  add("content_hash", "4: content hash of the layer", [](auto& e) { e[0].content_hash ^= 1; });
  add("stamp", "4: stamp of the layer", [](auto& e) { e[0].stamp_ns = 1; });
  add("type", "4: type of the layer", [](auto& e) { e[2].type = 1; });
  add("type_unknown", "types are those of the header", [](auto& e) { e[2].type = 2; });
  add("step", "4: step of the layer", [](auto& e) { e[0].step = 2; });
  add("step_12", "steps are 0..11", [](auto& e) { e[0].step = 12; });
  add("encoding", "4: encoding of the layer", [](auto& e) { e[0].encoding = 3; });
  add(
      "encoding_unknown", "encodings", [](auto& e) { e[0].encoding = 5; }, "unsupported");
  add("reserved", "bytes 56..63 are zero", [](auto& e) { e[0].reserved = 1; });
}

void add_pages(BadFiles& out) {
  const auto frame = [&](const std::string& name, const std::string& rule,
                         const std::function<std::string(const std::string&)>& change) {
    out.add("page_" + name, "damaged", rule, with_page_frame(change));
  };
  frame("frame_missing", "5: a page holds a frame", [](const auto&) { return std::string(); });
  frame("frame_cut", "4: exactly one zstd frame", [](const auto& f) { return f.substr(0, f.size() - 1); });
  frame("frame_and_more", "4: exactly one zstd frame", [](const auto& f) { return f + '\0'; });
  frame("two_frames", "4: exactly one zstd frame", [](const auto& f) { return f + f; });
  frame("skippable_frame", "4: skippable frames", [](const auto& f) { return skippable_frame() + f; });
  frame("frame_too_small", "4: content size of a frame",
        [](const auto&) { return zstd_frame(std::string(128, '\0')); });
  frame("frame_bomb", "4: content size of a frame",
        [](const auto&) { return zstd_frame(std::string(std::size_t{1} << 25, '\0')); });
  out.add("page_entries_in_flatbuffer", "damaged", "5: number of entries",
          with_page_payload([](BlockHead& head, std::string& payload) {
            flatbuffers::FlatBufferBuilder fb;
            fb.Finish(fbs::CreateIndexPage(fb, 2));
            std::string flat(reinterpret_cast<const char*>(fb.GetBufferPointer()), fb.GetSize());
            flat.resize((flat.size() + 7) / 8 * 8);
            payload = flat + payload.substr(head.m);
            head.m = static_cast<std::uint32_t>(flat.size());
          }));
  out.add("page_without_flatbuffer", "damaged", "5: a page starts with a FlatBuffer",
          with_page_payload([](BlockHead& head, std::string& payload) {
            payload = payload.substr(head.m);
            head.m = 0;
          }));
}

/// Pages of one entry each.
void add_roots(BadFiles& out) {
  const auto ref = [&](const std::string& name, const std::string& rule,
                       const std::function<fbs::PageRef(const fbs::PageRef&)>& change) {
    out.add("root_" + name, "damaged", "5: " + rule,
            with_root([=](Pages& pages, Totals&) { pages[1] = change(pages[1]); }));
  };
  using Fields = std::array<std::uint64_t, 5>;
  const auto field = [&](const std::string& name, const std::string& rule, std::size_t i,
                         std::uint64_t more) {
    ref(name, rule, [=](const auto& r) { return edited(r, [=](Fields& f) { f[i] += more; }); });
  };
  const auto same = [](Fields&) {};
  field("page_outside", "pages lie in the file", 0, 1 << 20);
  field("page_not_aligned", "2: blocks start at a multiple of 8", 0, 4);
  field("page_bytes", "place of a page", 1, 8);
  field("page_bytes_huge", "place of a page", 1, std::uint64_t{1} << 40);
  field("page_hash", "payload hash of a page", 2, 1);
  field("first_key", "first key of a page", 3, static_cast<std::uint64_t>(-1));
  field("last_key", "last key of a page", 4, 1);
  ref("range", "range of patch indices of a page", [=](const auto& r) { return edited(r, same, 1); });
  ref("entries", "number of entries of a page", [=](const auto& r) { return edited(r, same, 0, 1); });
  ref("entries_0", "number of entries of a page",
      [=](const auto& r) { return edited(r, same, 0, static_cast<std::uint32_t>(-1)); });
  ref("entries_4097", "at most 4096 entries", [=](const auto& r) { return edited(r, same, 0, 4096); });
  ref("reserved", "reserved is zero", [=](const auto& r) { return edited(r, same, 0, 0, 1); });
  const auto root = [&](const std::string& name, const std::string& rule,
                        const std::function<void(Pages&, Totals&)>& change) {
    out.add("root_" + name, "damaged", "5: " + rule, with_root(change));
  };
  root("pages_not_ascending", "order over pages",
       [](Pages& pages, Totals&) { std::swap(pages[0], pages[2]); });
  root("pages_of_a_patch_swapped", "order over pages",
       [](Pages& pages, Totals&) { std::swap(pages[0], pages[1]); });
  root("page_twice", "counts agree", [](Pages& pages, Totals&) { pages.push_back(pages[2]); });
  root("page_missing", "counts agree", [](Pages& pages, Totals&) { pages.pop_back(); });
  root("page_instead_of_another", "order over pages", [](Pages& pages, Totals&) { pages[1] = pages[0]; });
  root("totals_missing", "totals of each layer type", [](Pages&, Totals& t) { t.pop_back(); });
  root("totals_too_many", "totals of each layer type", [](Pages&, Totals& t) { t.push_back(t[0]); });
  root("totals_layers", "totals agree", [](Pages&, Totals& t) {
    t[0] = totals_with(t[0], t[0].layers() + 1, t[0].stored_bytes(), t[0].raw_bytes(), 1);
  });
  root("totals_step", "no entry has a step its type's totals do not know", [](Pages&, Totals& t) {
    t[1] = totals_with(t[1], t[1].layers(), t[1].stored_bytes(), t[1].raw_bytes(), 3, 1);
  });
  root("totals_steps_sum", "totals agree", [](Pages&, Totals& t) {
    t[0] = totals_with(t[0], t[0].layers(), t[0].stored_bytes(), t[0].raw_bytes(), 4);
  });
  root("totals_steps_wrap", "totals agree", [](Pages&, Totals& t) {
    t[0] = totals_with(t[0], t[0].layers(), t[0].stored_bytes(), t[0].raw_bytes(), 1, 4);
  });
  const auto total = [&](const std::string& name, const std::string& rule,
                         const std::function<void(Pages&, Totals&)>& change) {
    out.add("root_" + name, "damaged", "5: " + rule, with_root(change), true);
  };
  total("totals_between_types", "number of layers of a type", [](Pages&, Totals& t) {
    t[0] = totals_with(t[0], t[0].layers() - 1, t[0].stored_bytes(), t[0].raw_bytes(), 12, 1);
    t[1] = totals_with(t[1], t[1].layers() + 1, t[1].stored_bytes(), t[1].raw_bytes(), 1);
  });
  total("totals_stored_bytes", "stored bytes of a type", [](Pages&, Totals& t) {
    t[0] = totals_with(t[0], t[0].layers(), t[0].stored_bytes() + 8, t[0].raw_bytes());
  });
  total("totals_raw_bytes", "bytes of values of a type", [](Pages&, Totals& t) {
    t[0] = totals_with(t[0], t[0].layers(), t[0].stored_bytes(), t[0].raw_bytes() - 4);
  });
  out.add("root_with_body", "damaged", "5: the IndexRoot has no body", [] {
    Hooks hooks;
    hooks.payload = [](BlockHead& head, std::string& payload) {
      if (head.kind == kIndexRoot) payload.append(8, '\0');
    };
    return put_together(small_map(), hooks);
  }());
}

}  // namespace

void add_indices(BadFiles& out) {
  add_entries(out);
  add_pages(out);
  add_roots(out);
  Parts parts = small_map();
  std::swap(parts.layers[0], parts.layers[1]);
  Hooks hooks;
  hooks.page = [](std::vector<Entry>& entries) { std::swap(entries[0], entries[1]); };
  out.add("layers_not_in_order", "damaged", "2: layers stand in the order of section 7",
          put_together(parts, hooks), true);
}

}  // namespace apgm::test

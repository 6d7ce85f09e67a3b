// Preamble, blocks and footer.

#include "bad_files.hpp"
#include "small_map.hpp"

namespace apgm::test {
namespace {

using Change = std::function<void(std::string&)>;

std::string small_file(const Hooks& hooks = {}) { return put_together(small_map(), hooks); }

std::string changed(const Change& change) {
  std::string bytes = small_file();
  change(bytes);
  return bytes;
}

std::string with_preamble(const std::function<void(Preamble&)>& change) {
  Hooks hooks;
  hooks.preamble = change;
  return small_file(hooks);
}

std::string with_head(std::uint8_t kind, const std::function<void(BlockHead&)>& change) {
  Hooks hooks;
  hooks.head = [=, done = false](BlockHead& head) mutable {
    if (head.kind != kind || done) return;
    done = true;
    change(head);
  };
  return small_file(hooks);
}

std::string with_block(std::uint8_t kind, const Change& change) {
  Hooks hooks;
  hooks.block = [=, done = false](const BlockHead& head, std::string& block) mutable {
    if (head.kind != kind || done) return;
    done = true;
    change(block);
  };
  return small_file(hooks);
}

std::string with_footer(const std::function<void(Footer&)>& change) {
  Hooks hooks;
  hooks.footer = change;
  return small_file(hooks);
}

void flip(std::string& bytes, std::size_t at) { bytes[at] = static_cast<char>(bytes[at] ^ 1); }

void add_preambles(BadFiles& out) {
  const std::string magic = "2.1: the file starts with the magic";
  out.add("no_bytes", "foreign", magic, "");
  out.add("magic_cut", "foreign", magic, small_file().substr(0, 7));
  out.add("magic_first_byte", "foreign", magic, changed([](auto& b) { flip(b, 0); }));
  out.add("magic_last_byte", "foreign", magic, changed([](auto& b) { flip(b, 7); }));
  out.add("magic_line_ends_translated", "foreign", magic, changed([](auto& b) { b.erase(5, 1); }));

  out.add("preamble_cut", "damaged", "2.1: the preamble has 64 bytes", small_file().substr(0, 40));
  out.add("preamble_alone", "damaged", "2: a file has a footer", small_file().substr(0, 64));
  out.add("preamble_hash", "damaged", "2.1: hash of the preamble", changed([](auto& b) { flip(b, 56); }));
  out.add("preamble_reserved_flipped", "damaged", "2.1: hash of the preamble",
          changed([](auto& b) { flip(b, 30); }));
  const std::string version = "2.1: the major version is 1";
  out.add("version_0", "unsupported", version, with_preamble([](Preamble& p) { p.major = 0; }));
  out.add("version_2", "unsupported", version, with_preamble([](Preamble& p) { p.major = 2; }));
  const std::string feature = "2.1: no unknown incompat bit";
  out.add("incompat_bit_0", "unsupported", feature, with_preamble([](Preamble& p) { p.incompat = 1; }));
  out.add("incompat_bit_31", "unsupported", feature,
          with_preamble([](Preamble& p) { p.incompat = 0x80000000; }));
}

void add_blocks(BadFiles& out) {
  struct Of {
    std::uint8_t kind;
    std::string name;
  };
  for (const auto& [kind, name] : {Of{kMapHeader, "map_header"}, Of{kLayer, "layer"}, Of{kIndexPage, "page"},
                                   Of{kIndexRoot, "root"}, Of{kFooter, "footer"}}) {
    const auto block = [&, kind = kind, name = name](const std::string& what, const std::string& rule,
                                                     const Change& change) {
      out.add("block_" + name + "_" + what, "damaged", "2.2: " + rule, with_block(kind, change));
    };
    const auto head = [&, kind = kind, name = name](const std::string& what, const std::string& refused,
                                                    const std::string& rule,
                                                    const std::function<void(BlockHead&)>& change) {
      out.add("block_" + name + "_" + what, refused, "2.2: " + rule, with_head(kind, change));
    };
    head("sync", "damaged", "a block starts with its sync mark", [](BlockHead& h) { h.sync[7] = '2'; });
    head("kind", "damaged", "a block is of the kind it is named as",
         [](BlockHead& h) { h.kind = h.kind == kLayer ? kIndexPage : kLayer; });
    head("private_kind", "damaged", "a block is of the kind it is named as",
         [](BlockHead& h) { h.kind = 0x80; });
    head("unknown_flag", "unsupported", "flags that are not known", [](BlockHead& h) { h.flags = 2; });
    head("version", "unsupported", "version of the kind's layout", [](BlockHead& h) { h.version = 2; });
    head("reserved", "damaged", "bytes 48..55 are zero", [](BlockHead& h) { h.reserved = 1; });
    head("m_not_of_8", "damaged", "M is a multiple of 8", [](BlockHead& h) { h.m += 4; });
    head("m_over_p", "damaged", "P >= M",
         [](BlockHead& h) { h.m = static_cast<std::uint32_t>(h.p / 8 * 8 + 8); });
    head("p_over_place", "damaged", "P fits the size that is named", [](BlockHead& h) { h.p += 8; });
    head("p_huge", "damaged", "P fits the size that is named", [](BlockHead& h) { h.p = ~0ull - 7; });
    block("payload_hash", "hash of the payload", [](auto& b) { flip(b, 64 + 8); });
    block("head_hash", "hash of the header", [](auto& b) { flip(b, 57); });
  }
  const std::string key = "2.2: key of the block";
  out.add("block_layer_key", "damaged", key, with_head(kLayer, [](BlockHead& h) { ++h.key; }));
  out.add("block_page_key", "damaged", key, with_head(kIndexPage, [](BlockHead& h) { ++h.key; }));
  out.add("block_page_padding", "damaged", "2.2: the padding is zero", [] {
    Hooks hooks;
    hooks.block = [](const BlockHead& head, std::string& b) {
      if (head.p % 8 != 0) b.back() = 1;
    };
    return small_file(hooks);
  }());
}

void add_footers(BadFiles& out) {
  const auto footer = [&](const std::string& name, const std::string& rule,
                          const std::function<void(Footer&)>& change) {
    out.add("footer_" + name, "damaged", "2.3: " + rule, with_footer(change));
  };
  footer("end_mark", "the footer ends with APGMEND1", [](Footer& f) { f.end[7] = '2'; });
  footer("reserved", "bytes 120..183 are zero", [](Footer& f) { f.reserved[7] = 1; });
  footer("file_size", "size of the file", [](Footer& f) { f.file_bytes += 8; });
  footer("no_commit", "number of commits, 1 or more", [](Footer& f) { f.commits = 0; });
  footer("header_outside", "the MapHeader lies in the file", [](Footer& f) { f.header_offset = 1 << 20; });
  footer("header_offset_wraps", "the MapHeader lies in the file", [](Footer& f) { f.header_offset = ~7ull; });
  footer("header_not_aligned", "blocks start at a multiple of 8", [](Footer& f) { f.header_offset += 4; });
  footer("header_in_preamble", "the MapHeader lies behind the preamble",
         [](Footer& f) { f.header_offset = 0; });
  footer("header_bytes", "bytes of the MapHeader block", [](Footer& f) { f.header_bytes -= 8; });
  footer("header_hash", "hash of the MapHeader", [](Footer& f) { f.header_hash ^= 1; });
  footer("header_too_large", "3: a MapHeader has at most 16 MiB",
         [](Footer& f) { f.header_bytes = 1ull << 40; });
  footer("root_outside", "the IndexRoot lies in the file", [](Footer& f) { f.root_offset = f.file_bytes; });
  footer("root_bytes", "bytes of the IndexRoot block", [](Footer& f) { f.root_bytes += 8; });
  footer("root_hash", "hash of the IndexRoot", [](Footer& f) { f.root_hash ^= 1; });
  footer("root_is_header", "the IndexRoot is one", [](Footer& f) {
    f.root_offset = f.header_offset;
    f.root_bytes = f.header_bytes;
    f.root_hash = f.header_hash;
  });
  footer("layers", "number of layers", [](Footer& f) { f.layers += 1; });
  footer("more_patches_than_layers", "number of patches", [](Footer& f) { f.patches = f.layers + 1; });
  footer("no_patches", "number of patches", [](Footer& f) { f.patches = 0; });
  footer("extent", "least and greatest indices", [](Footer& f) { f.x_max += 1; });
  out.add("footer_patches", "damaged", "2.3: number of patches",
          with_footer([](Footer& f) { f.patches = 1; }), true);
  out.add("footer_content_id", "damaged", "6: content id",
          with_footer([](Footer& f) { f.content_id[0] ^= std::byte{1}; }), true);

  const std::string whole = small_file();
  const auto cut = [&](std::size_t left) { return whole.substr(0, left); };
  const std::string ends = "2: the footer ends the file";
  out.add("cut_by_1", "damaged", ends, cut(whole.size() - 1));
  out.add("cut_by_8", "damaged", ends, cut(whole.size() - 8));
  out.add("cut_before_footer", "damaged", ends, cut(whole.size() - 256));
  out.add("cut_in_half", "damaged", ends, cut(whole.size() / 2));
  out.add("one_byte_more", "damaged", ends, whole + '\0');
  out.add("eight_bytes_more", "damaged", ends, whole + std::string(8, '\0'));
  out.add("second_footer", "damaged", "2.3: size of the file", whole + whole.substr(whole.size() - 256));
  out.add("two_files_joined", "damaged", "2.3: size of the file", whole + whole);
}

/// What lies between the blocks that are read.
void add_order(BadFiles& out) {
  const auto before = [](std::uint8_t kind, std::string bytes) {
    Hooks hooks;
    hooks.before = [=, done = false](std::uint8_t at) mutable {
      const bool here = at == kind && !done;
      done = done || here;
      return here ? bytes : std::string();
    };
    return small_file(hooks);
  };
  BlockHead head;
  head.kind = 0x80;
  head.flags = 1;
  Hooks shifted;
  shifted.before = [](std::uint8_t at) {
    return std::string(at == kIndexPage || at == kIndexRoot ? 4 : 0, '\0');
  };
  out.add("page_not_aligned", "damaged", "2: blocks start at a multiple of 8", small_file(shifted));
  out.add("footer_not_aligned", "damaged", "2: blocks start at a multiple of 8",
          before(kFooter, std::string(4, '\0')), true);
  out.add("gap_between_blocks", "damaged", "2: blocks follow each other without gaps",
          before(kLayer, std::string(8, '\0')), true);
  out.add("gap_before_footer", "damaged", "2: blocks follow each other without gaps",
          before(kFooter, std::string(64, 'x')), true);
  out.add("unknown_block_that_must_be_understood", "unsupported", "2.2: flag bit 0 of an unknown kind",
          before(kIndexRoot, make_block(head, "")), true);
  head.flags = 0;
  std::string flipped = make_block(head, "a private block");
  flip(flipped, 70);
  out.add("unknown_block_damaged", "damaged", "2.2: hash of the payload", before(kIndexRoot, flipped), true);
  head.kind = kLayer;
  out.add("layer_that_nothing_names", "damaged", "2: a sealed file holds the layers of its index",
          before(kIndexPage, make_block(head, "")), true);
  out.add("block_of_another_commit", "damaged", "2.2: number of the commit",
          with_head(kLayer, [](BlockHead& h) { h.commit = 2; }), true);
}

}  // namespace

void add_structure(BadFiles& out) {
  add_preambles(out);
  add_blocks(out);
  add_footers(out);
  add_order(out);
}

}  // namespace apgm::test

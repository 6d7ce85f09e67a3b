// Archives: the chain of footers, the end, tags, what commits share.

#include "bad_files.hpp"
#include "small_archive.hpp"

namespace apgm::test {
namespace {

using Change = std::function<void(Footer&)>;

std::string second_footer(const Change& change) {
  Hooks hooks;
  hooks.footer = change;
  return two_commits(hooks).bytes;
}

/// Three commits; the first footer's place is known.
std::string third_footer(const std::function<void(Footer&, const ArchiveParts& first)>& change) {
  const ArchiveParts first = one_commit();
  ArchiveParts archive = two_commits();
  Hooks hooks;
  hooks.footer = [&](Footer& f) { change(f, first); };
  append_commit(archive, small_change(archive, 0.25f), hooks);
  return archive.bytes;
}

void add_chain(BadFiles& out) {
  const auto add = [&](const char* by, const std::string& name, const std::string& rule,
                       const Change& change) {
    out.add_by(by, "chain_" + name, "damaged", rule, second_footer(change));
  };
  add("commits", "names_no_footer", "11.1: a Footer names the one before it",
      [](Footer& f) { f.previous = f.header_offset; });
  add("reading", "names_itself", "2.3: a previous Footer lies before",
      [](Footer& f) { f.previous = f.file_bytes - 256; });
  add("reading", "beyond_the_file", "2.3: a previous Footer lies before",
      [](Footer& f) { f.previous = 1 << 20; });
  add("reading", "offset_wraps", "2.3: a previous Footer lies before", [](Footer& f) { f.previous = ~7ull; });
  add("reading", "not_aligned", "2.3: offsets are multiples of 8", [](Footer& f) { f.previous += 4; });
  add("reading", "in_preamble", "2.3: all lies behind the preamble", [](Footer& f) { f.previous = 8; });
  add("reading", "number_0", "11.1: numbers start at 1", [](Footer& f) { f.commits = 0; });
  add("verification", "number_of_another_commit", "11.1: every block has the commit's number",
      [](Footer& f) { f.commits = 9; });
  add("verification", "ends_too_early", "2.4: no block that nothing names",
      [](Footer& f) { f.previous = 0; });
  out.add_by("verification", "chain_skips_one", "damaged", "2.4: no block that nothing names",
             third_footer([](Footer& f, const ArchiveParts& first) { f.previous = first.last_footer; }));

  ArchiveParts less = one_commit();
  less.next_number = 3;
  append_commit(less, small_change(less));
  less.next_number = 2;
  append_commit(less, small_change(less, 0.25f));
  out.add_by("commits", "chain_number_less", "damaged", "11.1: a number is not less than the one before",
             less.bytes);

  ArchiveParts archive = one_commit();
  const std::size_t first = archive.last_footer;
  append_commit(archive, small_change(archive));
  const auto flipped = [&](std::size_t at) {
    std::string bytes = archive.bytes;
    flip(bytes, at);
    return bytes;
  };
  out.add_by("commits", "chain_older_payload_hash", "damaged", "2.2: hash of the payload",
             flipped(first + 64 + 70));
  out.add_by("commits", "chain_older_head_hash", "damaged", "2.2: hash of the header", flipped(first + 30));

  Hooks hooks;
  hooks.footer = [](Footer& f) { f.file_bytes += 8; };
  archive = {};
  append_commit(archive, small_map(), hooks);
  append_commit(archive, small_change(archive));
  out.add_by("commits", "chain_older_file_size", "damaged", "2.3: size of the file", archive.bytes);
}

void add_end(BadFiles& out) {
  const std::string whole = two_commits().bytes;
  const std::size_t footer = whole.size() - 256;
  const auto flipped = [&](const std::string& name, std::size_t at, const std::string& rule) {
    std::string bytes = whole;
    flip(bytes, at);
    out.add("end_" + name, "damaged", "11.3, 2: " + rule, bytes);
  };
  flipped("sync_15_of_16", footer + 7, "15 bytes of the marks are right");
  flipped("mark_15_of_16", whole.size() - 1, "15 bytes of the marks are right");
  flipped("payload_hash", footer + 64, "all bytes of the marks are right");
  flipped("head_hash", footer + 60, "all bytes of the marks are right");
  flipped("kind", footer + 8, "all bytes of the marks are right");
  out.add("end_other_file_size", "damaged", "11.3, 2: a Footer of another size of the file",
          second_footer([](Footer& f) { f.file_bytes -= 256; }));
  Hooks newer;
  newer.head = [](BlockHead& h) {
    if (h.kind == kFooter) h.version = 2;
  };
  out.add("end_newer_footer", "unsupported", "11.3, 2: unsupported, if that is all",
          two_commits(newer).bytes);
  const std::string one = one_commit().bytes;
  out.add("end_torn_first_commit", "damaged", "11.3, 3: there is no Footer", one.substr(0, one.size() - 100));
  out.add("end_before_first_footer", "damaged", "11.3, 3: there is no Footer",
          one.substr(0, one.size() - 256));
  out.add("end_preamble_alone", "damaged", "11.3, 3: there is no Footer", one.substr(0, 64));
  out.add("end_preamble_and_zeros", "damaged", "11.3, 3: there is no Footer",
          one.substr(0, 64) + std::string(1000, '\0'));
  out.add("end_footer_not_aligned", "damaged", "11.3, 3: a Footer lies at a multiple of 8",
          one.substr(0, one.size() - 256) + "half" + one.substr(one.size() - 256) + "tail");

  Hooks sealed;
  sealed.preamble = [](Preamble& p) { p.compat = 0; };
  ArchiveParts archive;
  append_commit(archive, small_map(), sealed);
  out.add("sealed_torn", "damaged", "11.3: in a sealed file rule 3 does not hold", archive.bytes + "torn");
  append_commit(archive, small_change(archive));
  out.add_by("verification", "sealed_two_commits", "damaged", "2: a sealed file has one Footer",
             archive.bytes);
}

void add_tags(BadFiles& out) {
  const auto add = [&](const std::string& name, const std::string& rule, const std::string& tags) {
    ArchiveParts archive = one_commit();
    Parts parts = small_change(archive);
    parts.header.metadata = {{"apgm.archive.tags", tags}};
    append_commit(archive, parts);
    out.add_by("commits", "tags_" + name, "damaged", "11.2: " + rule, archive.bytes);
  };
  const std::string form = "name=number for each";
  add("no_number", form, "a");
  add("empty_number", form, "a=");
  add("no_name", form, "=1");
  add("two_equal_signs", form, "a=1=1");
  add("text_for_a_number", form, "a=one");
  add("negative", form, "a=-1");
  add("number_over_64_bits", form, "a=18446744073709551617");
  const std::string decimal = "the number in decimal";
  add("number_0", decimal, "a=0");
  add("leading_zero", decimal, "a=01");
  const std::string order = "ascending by name";
  add("not_ascending", order, "b=1 a=1");
  add("twice", order, "a=1 a=2");
  const std::string spaces = "joined by single spaces";
  add("two_spaces", spaces, "a=1  b=1");
  add("leading_space", spaces, " a=1");
  add("trailing_space", spaces, "a=1 ");
  add("line_feed", spaces, "a=1\nb=1");
  const std::string name = "a name is [A-Za-z_][A-Za-z0-9_.+-]*, 1 to 64 bytes";
  add("digit_first", name, "1a=1");
  add("slash", name, "a/b=1");
  add("name_of_65_bytes", name, std::string(65, 'n') + "=1");
  const std::string known = "the number is that of a commit";
  add("of_no_commit", known, "a=3");
  add("of_a_commit_to_come", known, "a=1 b=18446744073709551615");
  add("present_but_empty", "absent where there is none", "");
}

/// A commit that shares what lies there; `spoil` changes the bytes behind it.
std::string with_spoilt(std::size_t entry, std::size_t at) {
  ArchiveParts archive = one_commit();
  const std::size_t offset = archive.entries[entry].offset;
  append_commit(archive, small_change(archive));
  flip(archive.bytes, offset + at);
  return archive.bytes;
}

/// The entry of the first layer names a Layer block that stands between IndexRoot and Footer.
std::string entry_behind_root() {
  ArchiveParts archive = one_commit();
  const Entry first = archive.entries[0];
  std::string block = archive.bytes.substr(first.offset, first.bytes);
  BlockHead head;
  std::memcpy(&head, block.data(), sizeof(head));
  head.commit = 2;
  block = make_block(head, block.substr(sizeof(head), head.p));
  std::uint64_t offset = first.offset;
  // Where the root ends depends on how the page compresses, which names the block.
  for (int round = 0; round < 8; ++round) {
    ArchiveParts next = archive;
    Parts parts = small_map();
    for (std::size_t i = 0; i < parts.layers.size(); ++i) parts.layers[i] = archive.shared(i);
    parts.layers[0].entry.offset = offset;
    append_commit(next, parts, with_before(kFooter, block));
    const std::uint64_t found = next.footer.root_offset + next.footer.root_bytes;
    if (found == offset) return next.bytes;
    offset = found;
  }
  throw std::runtime_error("no place for a block behind the root");
}

/// The second commit's type 1 is `type`, and shares the block of the first's type 1.
std::string shared_under(const LayerType& type) {
  ArchiveParts archive = one_commit();
  Parts parts = small_change(archive);
  parts.header.types = TypeTable({small_occupancy(), type});
  append_commit(archive, parts);
  return archive.bytes;
}

/// A type less: the number of the other moves, but its blocks are shared.
std::string shared_under_another_number() {
  ArchiveParts archive = one_commit();
  Parts parts;
  parts.header.types = TypeTable({LayerType::real("z", {"z"})});
  parts.layers = {archive.shared(1)};
  parts.layers[0].entry.type = 0;
  append_commit(archive, parts);
  return archive.bytes;
}

void add_sharing(BadFiles& out) {
  const std::string behind = "11.1: nothing names a block behind the commit's IndexRoot";
  out.add("shared_entry_behind_root", "damaged", behind, entry_behind_root());
  const std::string shared = "11.1: a Layer block is not shared with a commit where its type differs";
  out.add("shared_under_another_number", "damaged", shared, shared_under_another_number());
  LayerType slab = LayerType::real("z", {"z"});
  slab.slab = Slab{0, 1'000'000};
  const auto verification = [&](const std::string& name, const std::string& rule, std::string bytes,
                                const std::string& refused = "damaged") {
    out.add_by("verification", name, refused, rule, std::move(bytes));
  };
  verification("shared_under_another_name", shared, shared_under(LayerType::real("zz", {"z"})));
  verification("shared_under_another_channel", shared, shared_under(LayerType::real("z", {"height"})));
  verification("shared_under_another_slab", shared, shared_under(slab));
  verification("shared_under_another_background", shared,
               shared_under(LayerType::real("z", {"z"}, Policy::kSum)));
  out.add("shared_layer_payload_hash", "damaged", "2.2: hash of the payload", with_spoilt(2, 64 + 9));
  out.add("shared_layer_head_hash", "damaged", "2.2: hash of the header", with_spoilt(2, 57));
  out.add_by("commits", "older_layer_payload_hash", "damaged", "2.2: hash of the payload",
             with_spoilt(0, 64 + 9));

  BlockHead head;
  head.kind = kLayer;
  head.commit = 2;
  const std::string unnamed = "2.4: no block that nothing names";
  verification("unnamed_block_between_commits", unnamed,
               two_commits(with_before(kMapHeader, make_block(head, ""))).bytes);
  head.kind = kFooter;
  verification("unnamed_footer_within_a_commit", unnamed,
               two_commits(with_before(kIndexPage, make_block(head, std::string(192, '\0')))).bytes);
  verification("gap_between_commits", "2: blocks follow each other without gaps",
               two_commits(with_before(kMapHeader, std::string(8, '\0'))).bytes);
  head.kind = 9;
  head.flags = 1;
  verification("unknown_block_that_must_be_understood", "2.2: flag bit 0 of an unknown kind",
               two_commits(with_before(kMapHeader, make_block(head, ""))).bytes, "unsupported");
}

void add_commits(BadFiles& out) {
  const auto verification = [&](const std::string& name, const std::string& rule, std::string bytes) {
    out.add_by("verification", name, "damaged", rule, std::move(bytes));
  };
  struct Of {
    std::uint8_t kind;
    const char* name;
  };
  for (const auto& [kind, name] : {Of{kMapHeader, "map_header"}, Of{kLayer, "layer"}, Of{kIndexPage, "page"},
                                   Of{kIndexRoot, "root"}, Of{kFooter, "footer"}}) {
    Hooks hooks;
    hooks.head = [kind = kind](BlockHead& h) {
      if (h.kind == kind) h.commit = 1;
    };
    verification(std::string("number_of_the_") + name, "11.1: every block has the commit's number",
                 two_commits(hooks).bytes);
  }
  Hooks hooks;
  hooks.footer = [](Footer& f) { f.content_id[3] ^= std::byte{1}; };
  const auto older = [&] {
    ArchiveParts archive;
    append_commit(archive, small_map(), hooks);
    append_commit(archive, small_change(archive));
    return archive.bytes;
  };
  verification("older_content_id", "2.4: content id, of each commit", older());
  hooks.footer = [](Footer& f) { f.patches = 1; };
  verification("older_patches", "2.4: number of patches, of each commit", older());
  hooks.footer = [](Footer& f) { f.root_hash ^= 1; };
  out.add_by("commits", "older_root_hash", "damaged", "2.3: hash of the IndexRoot", older());
  hooks.footer = [](Footer& f) { f.header_hash ^= 1; };
  out.add_by("commits", "older_header_hash", "damaged", "2.3: hash of the MapHeader", older());

  const auto other_frame = [&](const std::function<void(Frame&)>& change) {
    ArchiveParts archive = one_commit();
    Parts parts = small_change(archive);
    change(parts.header.frame);
    append_commit(archive, parts);
    return archive.bytes;
  };
  const std::string frame = "11.1: the frame is the same in all commits";
  verification("frame_edge", frame, other_frame([](Frame& f) { f.edge_um += 1000; }));
  verification("frame_datum", frame, other_frame([](Frame& f) { f.datum_y_um = 1; }));
  verification("frame_epsg", frame, other_frame([](Frame& f) { f.epsg = 32632; }));
  verification("frame_id", frame, other_frame([](Frame& f) { f.frame_id = "odom"; }));

  const auto replaced = [&](const Change& change) {
    ArchiveParts archive = one_commit();
    const Footer first = archive.footer;
    append_commit(archive, small_change(archive));
    Hooks replacing;
    replacing.footer = [&](Footer& f) {
      change(f);
      if (f.root_offset != 0) return;
      f.root_offset = first.root_offset;
      f.root_bytes = first.root_bytes;
      f.root_hash = first.root_hash;
    };
    replace_header(archive, small_map().header, replacing);
    return archive.bytes;
  };
  const std::string same = "11.1: a replaced header has the same IndexRoot, content id and counts";
  verification("replaced_other_content_id", same,
               replaced([](Footer& f) { f.content_id[0] ^= std::byte{1}; }));
  ArchiveParts again = one_commit();
  again.next_number = 1;
  append_commit(again, small_change(again));
  verification("replaced_by_another_map", same, again.bytes);
  verification("replaced_other_root", same, replaced([](Footer& f) { f.root_offset = 0; }));
}

}  // namespace

void add_archives(BadFiles& out) {
  add_chain(out);
  add_end(out);
  add_tags(out);
  add_sharing(out);
  add_commits(out);
}

}  // namespace apgm::test

#include <algorithm>
#include <bit>
#include <span>

#include "commits.hpp"
#include "content_id.hpp"
#include "index.hpp"
#include "layer_block.hpp"
#include "located.hpp"
#include "map_header.hpp"
#include "verify_state.hpp"

namespace apgm::format {

namespace {

/// Of all that the meaning of index entries hangs on.
std::uint64_t digest_of_tables(const MapHeader& header) {
  const Frame& f = header.frame;
  std::vector<std::uint64_t> parts{
      static_cast<std::uint64_t>(f.edge_um), static_cast<std::uint64_t>(f.datum_x_um),
      static_cast<std::uint64_t>(f.datum_y_um), static_cast<std::uint64_t>(f.epsg.value_or(0)),
      hash_of(std::as_bytes(std::span(f.frame_id)))};
  for (const LayerType& type : header.types) {
    parts.push_back(space_hash(type));
    parts.push_back(static_cast<std::uint64_t>(type.policy));
  }
  return hash_of(std::as_bytes(std::span(parts)));
}

/// Of what a type's stored cells stand for, background included: where it differs, no block is shared.
std::uint64_t digest_of_meaning(const LayerType& type) {
  std::vector<std::uint64_t> parts{space_hash(type)};
  for (int c = 0; c < static_cast<int>(type.channels.size()); ++c) {
    parts.push_back(std::bit_cast<std::uint32_t>(type.background(c)));
  }
  return hash_of(std::as_bytes(std::span(parts))) | 1;
}

}  // namespace

/// What the entries of an index add up to.
struct Verification::CommitTotals {
  explicit CommitTotals(const MapHeader& header) : id(header), types(header.types.size()) {}

  ContentId id;
  std::vector<Summary::OfType> types;
  std::uint64_t patches = 0;
  bool any = false;
  std::uint64_t key = 0;     // of the last entry
  std::uint16_t type = 0;    // of the last entry
  std::uint64_t offset = 0;  // of the last entry
};

void Verification::check_commit(const FooterAt& at, bool newest) {
  check_cancelled();
  const Footer& f = at.footer;
  const std::string commit = archive ? " of commit " + std::to_string(f.commits) : "";
  if (Seen* footer = find(at.offset)) footer->named = true;
  const bool header_there = named_block(f.header_offset, f.header_bytes, f.header_hash, Kind::kMapHeader,
                                        "the map header" + commit);
  const bool root_there =
      named_block(f.root_offset, f.root_bytes, f.root_hash, Kind::kIndexRoot, "the index root" + commit);
  if (newest) report.content_id = to_hex(f.content_id);
  if (!header_there) return;
  std::uint64_t offset = f.header_offset;
  try {
    const KnownHeader& header = check_header(f);
    if (!header.whole) return;
    if (newest && archive) check_tags(f);
    if (!root_there) return;
    offset = f.root_offset;
    const KnownRoot& root = check_root(f, header.tables);
    if (root.whole) check_totals(at, root);
  } catch (const Error& e) {
    if (!tells_of_file(e)) throw;
    problem(offset, offset == f.header_offset ? "the map header" + commit : "the index root" + commit, e);
  }
}

/// Headers that stand side by side are read once.
const MapHeader& Verification::read_header(const Footer& f) {
  const std::pair at(f.header_offset, f.header_hash);
  if (header_at_ == at) return header_;
  header_at_.reset();
  std::vector<std::byte> bytes(f.header_bytes);
  file_.read(f.header_offset, bytes);
  header_ = read_map_header(bytes);
  header_at_ = at;
  return header_;
}

/// The first time that a footer names it; faults are told once.
const Verification::KnownHeader& Verification::check_header(const Footer& f) {
  const auto [at, is_new] = headers_.try_emplace({f.header_offset, f.header_hash});
  KnownHeader& known = at->second;
  if (!is_new) return known;
  const MapHeader& header = read_header(f);
  known.tables = digest_of_tables(header);
  known.whole = true;
  if (!frame_) frame_ = header.frame;
  if (*frame_ != header.frame) {
    problem(f.header_offset, "the map header of commit " + std::to_string(f.commits) +
                                 ": its frame is not that of the newest commit");
  }
  return known;
}

/// Of the newest header: only its tags count.
void Verification::check_tags(const Footer& f) {
  for (const auto& [name, number] : tags_of(read_header(f))) {
    if (numbers_.empty() || std::ranges::binary_search(numbers_, number)) continue;
    problem(f.header_offset, "tag '" + name + "' names a commit that does not exist");
  }
}

/// The same of an index root.
const Verification::KnownRoot& Verification::check_root(const Footer& f, std::uint64_t tables) {
  const auto [at, is_new] = roots_.try_emplace({f.root_offset, f.root_hash, tables});
  if (is_new) read_index(f, tables, at->second);
  return at->second;
}

void Verification::read_index(const Footer& f, std::uint64_t tables, KnownRoot& known) {
  const MapHeader& header = read_header(f);
  std::vector<std::byte> bytes(f.root_bytes);
  file_.read(f.root_offset, bytes);
  const Root root = read_root(bytes, f.root_offset, header.types.size());
  CommitTotals totals(header);
  if (!check_pages(root, f, header, tables, totals)) return;
  for (const fbs::PageRef& ref : root.pages) {
    known.layers += ref.entries();
    known.range.add(PatchRange{{ref.x_min(), ref.y_min()}, {ref.x_max(), ref.y_max()}});
  }
  known.patches = totals.patches;
  known.content_id = totals.id.value();
  known.whole = true;
  if (totals.types != root.totals) {
    problem(f.root_offset, "the index root's totals are not those of its entries");
  }
}

/// False if not all entries could be seen.
bool Verification::check_pages(const Root& root, const Footer& footer, const MapHeader& header,
                               std::uint64_t tables, CommitTotals& totals) {
  bool all = true;
  std::vector<std::byte> bytes;
  std::vector<IndexEntry> entries;
  std::vector<std::uint64_t> meanings;
  for (const LayerType& type : header.types) meanings.push_back(digest_of_meaning(type));
  for (const fbs::PageRef& ref : root.pages) {
    check_cancelled();
    if (!named_block(ref.offset(), ref.bytes(), ref.hash(), Kind::kIndexPage, "an index page")) {
      all = false;
      continue;
    }
    try {
      bytes.resize(ref.bytes());
      file_.read(ref.offset(), bytes);
      read_page(bytes, ref, footer.root_offset, header.types, root, entries);
    } catch (const Error& e) {
      if (!tells_of_file(e)) throw;
      problem(ref.offset(), "", e);
      all = false;
      continue;
    }
    const IndexEntry& first = entries.front();
    if (totals.any && std::pair(totals.key, totals.type) >= std::pair(first.key, first.type)) {
      problem(ref.offset(), "index entries are not in order");
      all = false;
    }
    for (const IndexEntry& e : entries) add_entry(e, header, totals);
    if (!pages_.insert({ref.offset(), ref.hash(), tables}).second) continue;
    for (const IndexEntry& e : entries) check_entry(e, header.types[e.type], meanings[e.type]);
  }
  return all;
}

void Verification::add_entry(const IndexEntry& e, const MapHeader& header, CommitTotals& totals) {
  const LayerType& type = header.types[e.type];
  const PatchIndex patch{e.ix, e.iy};
  totals.patches += !totals.any || totals.key != e.key;
  if (!archive && totals.any && e.offset <= totals.offset) {
    problem(e.offset, name_of(patch, type.name) + ": the layer does not stand in its order", patch,
            type.name);
  }
  totals.any = true;
  totals.key = e.key;
  totals.type = e.type;
  totals.offset = e.offset;
  totals.id.add(patch, e.type, e.step, e.content_hash);
  Summary::OfType& of = totals.types[e.type];
  ++of.layers;
  ++of.layers_at[e.step];
  of.stored_bytes += e.stored_bytes;
  of.raw_bytes += value_bytes(type, e.step);
}

/// Against the block it names.
void Verification::check_entry(const IndexEntry& e, const LayerType& type, std::uint64_t meaning) {
  const PatchIndex patch{e.ix, e.iy};
  const auto wrong = [&](std::string_view what) {
    problem(e.offset, name_of(patch, type.name) + ": " + std::string(what), patch, type.name);
  };
  Seen* seen = find(e.offset);
  if (seen == nullptr || seen->offset != e.offset) {
    // Once, however many commits name it.
    if (told_in_gaps_.size() < options_.max_problems && !told_in_gaps_.insert(e.offset).second) return;
    if (seen != nullptr && seen->kind == Kind{}) seen->told = true;
    return wrong("there is no block");
  }
  seen->named = true;
  if (seen->told) return;
  const char* fault = seen->fault;
  if (fault == nullptr) {
    if (seen->kind != Kind::kLayer) {
      fault = "the block is no layer";
    } else if (seen->bytes != e.stored_bytes || seen->payload_hash != e.stored_hash || seen->key != e.key ||
               (!seen->newer && seen->facts != facts_of(info_of(e)))) {
      fault = "the block is not the one the index names";
    } else if (seen->meaning != 0 && seen->meaning != meaning) {
      fault = "commits share the block under types that differ";
    }
  }
  seen->meaning = meaning;
  if (fault != nullptr) {
    seen->told = true;
    return wrong(fault);
  }
  if (options_.deep && !seen->newer) decode_soon(*seen, e, type);
}

void Verification::check_totals(const FooterAt& at, const KnownRoot& root) {
  const Footer& f = at.footer;
  if (root.layers != f.layers || root.patches != f.patches ||
      !(root.range == PatchRange{{f.x_min, f.y_min}, {f.x_max, f.y_max}})) {
    problem(at.offset, "the index does not hold what the footer says");
  }
  if (root.content_id != f.content_id) problem(at.offset, "the content id is not that of the layers");
}

}  // namespace apgm::format

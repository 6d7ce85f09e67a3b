#include <algorithm>
#include <atomic>
#include <thread>
#include <tuple>

#include "index.hpp"
#include "layer_block.hpp"
#include "located.hpp"
#include "map_header.hpp"
#include "parallel.hpp"
#include "scan.hpp"
#include "verify_state.hpp"

namespace apgm::format {
namespace {

constexpr std::uint64_t kProgressBytes = std::uint64_t{4} << 20;
/// Parts of this size keep all threads busy, and cost nothing to start.
constexpr std::uint64_t kPartBytes = std::uint64_t{4} << 20;

bool is_known(Kind kind) { return kind >= Kind::kMapHeader && kind <= Kind::kFooter; }

}  // namespace

std::uint64_t facts_of(const LayerInfo& l) {
  struct Facts {
    std::int32_t ix, iy;
    std::uint64_t content_hash;
    std::int64_t stamp_ns;
    std::uint32_t type, step_and_encoding;
  };
  static_assert(sizeof(Facts) == 32);
  return hash_of(bytes_of(Facts{l.patch.x, l.patch.y, l.content_hash, l.stamp_ns, l.type,
                                static_cast<std::uint32_t>(l.step) << 8 | l.encoding}));
}

LayerInfo info_of(const IndexEntry& e) {
  return {{e.ix, e.iy}, e.type, e.step, e.encoding, e.stored_bytes, e.content_hash, e.stamp_ns, e.offset};
}

/// Parts depend on the file alone, so that the report does not depend on the number of threads.
std::vector<Verification::Part> Verification::parts_of(std::uint64_t end, const FooterAt* last) const {
  std::vector<Part> parts(1);
  parts.back().from = sizeof(Preamble);
  try {
    if (last != nullptr) {
      const Footer& f = last->footer;
      std::vector<std::byte> bytes(f.header_bytes);
      file_.read(f.header_offset, bytes);
      const std::size_t types = read_map_header(bytes).types.size();
      bytes.resize(f.root_bytes);
      file_.read(f.root_offset, bytes);
      for (const fbs::PageRef& ref : read_root(bytes, f.root_offset, types).pages) {
        if (ref.offset() < parts.back().from + kPartBytes || ref.offset() >= end) continue;
        parts.back().to = ref.offset();
        parts.emplace_back().from = ref.offset();
      }
    }
  } catch (const Error& e) {
    if (!tells_of_file(e)) throw;  // the rest is told of when the commit is checked
  }
  parts.back().to = end;
  return parts;
}

void Verification::walk(std::uint64_t end, const FooterAt* last) {
  std::vector<Part> parts = parts_of(end, last);
  const std::thread::id caller = std::this_thread::get_id();
  std::atomic<std::uint64_t> done{0}, blocks{0};
  parallel_for(
      parts.size(), options_.threads,
      [&](std::size_t i) {
        std::uint64_t counted = 0;
        walk_part(parts[i], [&](std::uint64_t bytes) {
          const std::uint64_t now = done += bytes;
          check_cancelled();
          blocks += parts[i].table.size() - counted;
          counted = parts[i].table.size();
          check_list(options_.max_memory_bytes, 2 * blocks * sizeof(Seen), now, file_.size());
          if (options_.progress && std::this_thread::get_id() == caller) options_.progress(now, file_.size());
        });
      },
      1);
  join(std::move(parts));
}

void Verification::walk_part(Part& part, const std::function<void(std::uint64_t)>& tell) const {
  BlockScan scan(file_, part.from, part.to);
  Spot spot;
  std::uint64_t told = part.from;
  while (scan.next(spot)) {
    take(spot, part);
    const std::uint64_t at = spot.offset + spot.bytes;
    if (at - told < kProgressBytes) continue;
    tell(at - told);
    told = at;
  }
  tell(part.to - told);
}

void Verification::join(std::vector<Part> parts) {
  std::size_t blocks = 0;
  for (const Part& part : parts) blocks += part.table.size();
  table_.reserve(blocks);
  for (Part& part : parts) {
    table_.insert(table_.end(), part.table.begin(), part.table.end());
    part.table = {};
    report.blocks += part.blocks;
    report.layers += part.layers;
    report.unknown_blocks += part.unknown_blocks;
    if (!unsupported && part.unsupported) unsupported = part.unsupported;
  }
}

void Verification::take(const Spot& spot, Part& part) const {
  Seen seen;
  seen.offset = spot.offset;
  seen.bytes = spot.bytes;
  if (spot.state != Spot::State::kWhole) seen.fault = spot.why;
  if (spot.state == Spot::State::kNoBlock) {
    part.table.push_back(seen);
    return;
  }
  const BlockHeader& h = spot.header;
  seen.kind = h.kind;
  seen.payload_hash = h.payload_hash;
  seen.commit = h.commit;
  seen.key = h.key;
  if (seen.fault == nullptr && spot.offset % 8 != 0) seen.fault = "a block does not start at a multiple of 8";
  if (seen.fault == nullptr && h.context != 0) seen.fault = "a block header holds reserved values";
  if (seen.fault == nullptr) {
    ++part.blocks;
    part.layers += h.kind == Kind::kLayer;
    part.unknown_blocks += !is_known(h.kind);
    seen.newer = h.version != 1 || h.flags > 1;
    if ((seen.newer || (!is_known(h.kind) && h.flags == 1)) && !part.unsupported) {
      part.unsupported = located_error(
          file_, spot.offset, "",
          Error(ErrorCode::kUnsupported,
                seen.newer
                    ? "a block has version " + std::to_string(h.version) + " of its layout"
                    : "a block of kind " + std::to_string(static_cast<int>(h.kind)) + " must be understood")
              .hint("a newer version of apgm can read it"),
          nullptr);
    }
    if (h.kind == Kind::kLayer && !seen.newer) {
      try {
        if (spot.payload.size() < h.meta_bytes) throw Error(ErrorCode::kDamaged, "the block is malformed");
        const Bytes meta = spot.payload.first(h.meta_bytes);
        seen.facts = facts_of(read_layer_block({h, meta, spot.payload.subspan(h.meta_bytes)}).info);
      } catch (const Error&) {
        seen.fault = "the block is malformed";
      }
    }
  }
  part.table.push_back(seen);
}

Seen* Verification::find(std::uint64_t offset) {
  const auto holds = [&](const Seen& s) { return offset >= s.offset && offset - s.offset < s.bytes; };
  for (const std::size_t at : {hint_, hint_ + 1}) {
    if (at < table_.size() && holds(table_[at])) {
      hint_ = at;
      return &table_[at];
    }
  }
  const auto after = std::ranges::upper_bound(table_, offset, {}, &Seen::offset);
  if (after == table_.begin() || !holds(*(after - 1))) return nullptr;
  hint_ = static_cast<std::size_t>(after - table_.begin()) - 1;
  return &table_[hint_];
}

/// A block that a footer or root names, if it is there and is the one; else nullptr, and a problem.
Seen* Verification::named_block(std::uint64_t offset, std::uint64_t bytes, std::uint64_t hash, Kind kind,
                                const std::string& what) {
  Seen* seen = find(offset);
  const bool there = seen != nullptr && seen->offset == offset;
  if (seen != nullptr && (there || seen->kind == Kind{})) seen->named = true;
  if (there && seen->fault != nullptr) {
    if (!seen->told) problem(offset, what + ": " + seen->fault);
    seen->told = true;
    return nullptr;
  }
  if (!there || seen->kind != kind || seen->bytes != bytes || seen->payload_hash != hash) {
    if (seen != nullptr && seen->kind == Kind{}) seen->told = true;
    problem(offset, what + (there ? " is not the one that is named there" : ": there is no block"));
    return nullptr;
  }
  return seen;
}

namespace {

/// A footer that replaces a header changes nothing else of its commit.
bool same_map(const Footer& a, const Footer& b) {
  const auto said = [](const Footer& f) {
    return std::tuple(f.root_offset, f.root_bytes, f.root_hash, f.patches, f.layers, f.content_id, f.x_min,
                      f.y_min, f.x_max, f.y_max);
  };
  return said(a) == said(b);
}

}  // namespace

void Verification::check_chain(const std::vector<FooterAt>& chain) {
  auto block = table_.begin();
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const Footer& f = chain[i].footer;
    if (!archive && (f.commits != 1 || f.previous_footer != 0)) {
      problem(chain[i].offset, "a sealed file has one commit");
    }
    if (numbers_.empty() || numbers_.back() != f.commits) {
      numbers_.push_back(f.commits);
    } else if (!same_map(f, chain[i - 1].footer)) {
      problem(chain[i].offset, "the footer of a replaced header names another map than the one before");
    }
    for (; block != table_.end() && block->offset <= chain[i].offset; ++block) {
      if (block->kind == Kind{} || block->fault != nullptr || block->commit == f.commits) continue;
      block->fault = "a block has another commit's number";
    }
  }
}

void Verification::check_rest(bool all_commits_read) {
  for (Seen& seen : table_) {
    if (seen.told) continue;
    if (seen.fault != nullptr) {
      std::optional<PatchIndex> patch;
      std::string where;
      if (seen.kind == Kind::kLayer) {
        patch = patch_of_key(seen.key);
        where = "a layer of patch (" + std::to_string(patch->x) + "," + std::to_string(patch->y) + "): ";
      }
      problem(seen.offset, where + seen.fault, patch);
    } else if (all_commits_read && !seen.named && is_known(seen.kind)) {
      problem(seen.offset, "a block that neither footer nor index names");
    }
  }
}

}  // namespace apgm::format

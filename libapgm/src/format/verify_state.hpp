#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/core/source.hpp"
#include "apgm/format/verify.hpp"
#include "block.hpp"
#include "footer.hpp"
#include "input_file.hpp"

namespace apgm::format {

struct Root;
struct Spot;

/// A place of the file as the walk found it.
struct Seen {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
  std::uint64_t payload_hash = 0;
  std::uint64_t key = 0;
  std::uint64_t facts = 0;  ///< of a layer: digest of what its index entry must say
  std::uint64_t commit = 0;
  std::uint64_t meaning = 0;    ///< of a layer that an entry names, digest of its type; 0: none yet
  const char* fault = nullptr;  ///< what is wrong with it, nullptr: nothing
  std::uint32_t space = 0;      ///< of a layer that was decoded, the kind of cells it was taken for
  Kind kind{};                  ///< 0: no block
  bool named = false;           ///< by a footer or an index
  bool told = false;            ///< a problem names it
  bool newer = false;           ///< of a layout this version does not know
};

/// False of what ends the work: a file that cannot be read, a budget, a cancel.
inline bool tells_of_file(const Error& error) {
  return error.code() == ErrorCode::kDamaged || error.code() == ErrorCode::kUnsupported;
}

/// What one verification knows. The parts of it stand in verify_*.cpp.
class Verification {
 public:
  Verification(const InputFile& file, const VerifyOptions& options) : file_(file), options_(options) {}
  /// Walks the blocks of [64, end) into the table, in parts that start where `last`, if any, says that index
  /// pages stand.
  void walk(std::uint64_t end, const FooterAt* last);
  /// Checks the commit that ends with `at` against the table.
  void check_commit(const FooterAt& at, bool newest);
  /// The chain of footers, and the commit number of each block between them.
  void check_chain(const std::vector<FooterAt>& oldest_first);
  /// Decodes the layers that wait for it.
  void decode_now();
  /// What nothing named, and what was not told of yet.
  void check_rest(bool all_commits_read);

  void problem(std::uint64_t offset, std::string text, std::optional<PatchIndex> patch = {},
               std::string layer = {});
  /// `error` of a check at `offset`: a problem, or noted as unsupported.
  void problem(std::uint64_t offset, const std::string& where, const Error& error);
  void check_cancelled() const;

  bool archive = false;
  VerifyReport report;
  std::optional<Error> unsupported;  ///< the first that was met

 private:
  struct CommitTotals;
  struct DeepJob {
    IndexEntry entry;
    std::uint32_t space;  // of spaces_
    std::string layer;    // name of its type
    std::optional<Error> error;
  };
  /// A map header that some footers name.
  struct KnownHeader {
    std::uint64_t tables = 0;  // digest of frame and types
    bool whole = false;
  };
  /// An index root, in the light of one frame and table of types: many footers may name it.
  struct KnownRoot {
    bool whole = false;  // and so are all its pages
    std::uint64_t layers = 0, patches = 0;
    PatchRange range;
    std::array<std::byte, 16> content_id{};
  };

  Seen* find(std::uint64_t offset);
  Seen* named_block(std::uint64_t offset, std::uint64_t bytes, std::uint64_t hash, Kind kind,
                    const std::string& what);
  /// What is found in a part of the file.
  struct Part {
    std::uint64_t from = 0, to = 0;
    std::vector<Seen> table;
    std::uint64_t blocks = 0, layers = 0, unknown_blocks = 0;
    std::optional<Error> unsupported;
  };
  std::vector<Part> parts_of(std::uint64_t end, const FooterAt* last) const;
  void walk_part(Part& part, const std::function<void(std::uint64_t)>& tell) const;
  void take(const Spot& spot, Part& part) const;
  void join(std::vector<Part> parts);
  const MapHeader& read_header(const Footer& footer);
  const KnownHeader& check_header(const Footer& footer);
  void check_tags(const Footer& footer);
  const KnownRoot& check_root(const Footer& footer, std::uint64_t tables);
  void read_index(const Footer& footer, std::uint64_t tables, KnownRoot& known);
  void add_entry(const IndexEntry& entry, const MapHeader& header, CommitTotals& totals);
  void check_entry(const IndexEntry& entry, const LayerType& type, std::uint64_t meaning);
  bool check_pages(const Root& root, const Footer& footer, const MapHeader& header, std::uint64_t tables,
                   CommitTotals& totals);
  void check_totals(const FooterAt& at, const KnownRoot& root);
  void decode_soon(Seen& block, const IndexEntry& entry, const LayerType& type);

  const InputFile& file_;
  const VerifyOptions& options_;
  std::vector<Seen> table_;  // by offset, without gaps
  std::size_t hint_ = 0;     // entries mostly name blocks in their order
  std::set<std::uint64_t> told_in_gaps_;
  std::vector<LayerType> spaces_;  // that layers were decoded as; Seen::space counts from 1
  std::vector<DeepJob> jobs_;

  std::vector<std::uint64_t> numbers_;  // of all commits, ascending, once check_chain has seen them
  std::optional<Frame> frame_;          // of the newest header that could be read
  MapHeader header_;                    // the one read last
  std::optional<std::pair<std::uint64_t, std::uint64_t>> header_at_;         // its offset and hash
  std::map<std::pair<std::uint64_t, std::uint64_t>, KnownHeader> headers_;   // the same
  using InTables = std::tuple<std::uint64_t, std::uint64_t, std::uint64_t>;  // offset, hash, tables
  std::map<InTables, KnownRoot> roots_;
  std::set<InTables> pages_;  // whose entries were compared with the blocks
};

/// Digest of what an index entry and the block it names both say.
std::uint64_t facts_of(const LayerInfo& layer);
LayerInfo info_of(const IndexEntry& entry);

}  // namespace apgm::format

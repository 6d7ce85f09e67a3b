#pragma once

#include <array>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <unordered_set>
#include <utility>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/format/recover.hpp"
#include "index.hpp"
#include "recover_scan.hpp"

namespace apgm::format {

/// A layer that goes into the recovered map.
struct Chosen {
  LayerInfo info;  ///< type in the table of the map; locator: offset in the file
  std::uint64_t key = 0;
  std::uint64_t commit = 0;
};

/// Chooses, of what is whole in a file, what belongs to the map.
class RecoverPlan {
 public:
  RecoverPlan(const InputFile& file, Salvage& salvage, const RecoverOptions& options, RecoverReport& report)
      : file_(file), salvage_(salvage), options_(options), report_(report) {}

  /// Fills header and layers. @throws Error as Recovery
  void make();
  /// Says what is missing, once `layers` holds what decodes.
  void tell_losses();
  void lose(std::uint64_t offset, std::string text, std::optional<PatchIndex> patch = {},
            std::string layer = {});
  /// True once no more losses are told of; what it takes to name one can then be spared.
  bool counts_only() const { return report_.losses.size() >= options_.max_losses; }
  void count_loss() { ++report_.loss_count; }
  /// @throws Error{kCancelled}
  void check_cancelled() const;
  /// Content id that the newest footer states; empty: none is whole.
  std::string stated_id() const;

  MapHeader header;
  std::vector<Chosen> layers;  ///< by (key, type)

 private:
  using Order = std::pair<std::uint64_t, std::uint16_t>;
  struct LostEntry {
    Order order;
    PatchIndex patch;
    std::uint64_t offset;
    std::optional<std::uint64_t> kept_commit;  // an older state stands in
  };
  struct Remembered {
    std::uint64_t offset = 0;         // 0: none
    std::optional<MapHeader> header;  // none: it cannot be used
  };
  struct LostPage {
    std::uint64_t offset, first_key, last_key, entries;
  };

  // recover_header.cpp: which header and index are those of the newest commit.
  void find_newest();
  bool find_root();
  bool use_root(const FoundBlock& root, const FoundBlock* header_block, const MapHeader* given);
  bool is_of_another_file(const Root& root);
  void use_header_alone();
  void find_headers();
  const FoundBlock* header_of(std::uint64_t commit) const;
  const FoundBlock* newest_header(std::uint64_t up_to) const;
  MapHeader read_header(const FoundBlock& block) const;
  const MapHeader* remembered_header(const FoundBlock& block);
  void took_header(const FoundBlock* block);

  // recover_types.cpp: what the types of a commit are in the map.
  void read_tables();
  void read_table(std::uint64_t commit, const TypeTable& types);
  std::optional<std::uint16_t> type_in_map(const FoundLayer& layer) const;

  // recover_plan.cpp: the layers.
  void take_index();
  bool is_index_of_few() const;
  void forget_index();
  void take_entry(const IndexEntry& entry);
  void take_unindexed();
  void find_older_states();
  bool may_be_taken(const FoundLayer& layer) const;
  void take_group(std::size_t from, std::size_t to);
  void add_unindexed(const FoundLayer& layer, std::uint16_t type);
  bool in_lost_page(std::uint64_t key) const;
  std::string why_missing(std::uint64_t offset) const;
  void count_left_out();
  bool has_all_layers() const { return footer_ && layers.size() == footer_->layers; }
  bool has_stated_id() const;
  void check_given_header() const;
  void tell_unlisted();

  const InputFile& file_;
  Salvage& salvage_;
  const RecoverOptions& options_;
  RecoverReport& report_;

  std::optional<Footer> footer_;  // of the newest commit, if whole
  bool footer_in_place_ = false;
  std::uint64_t newest_ = 0;  // commit
  std::optional<Root> root_;
  std::uint64_t root_commit_ = 0;
  std::optional<FoundBlock> named_header_;         // by the newest footer
  bool header_is_given_ = false;                   // by options_
  std::map<std::uint64_t, FoundBlock> header_of_;  // by commit, its last
  std::array<Remembered, 2> remembered_;           // the named one, another
  using Numbers = std::vector<std::uint16_t>;      // by type of a commit: its number in the map, or kNoType
  std::set<Numbers> tables_;                       // each once
  std::map<std::uint64_t, const Numbers*> table_of_;  // by commit
  struct Agreed {
    LayerType type;
    bool differs = false;
  };
  std::map<std::uint16_t, Agreed> agreed_;  // what all tables say of a number
  std::unordered_set<std::uint64_t> page_hashes_;
  std::vector<Chosen> unindexed_;
  std::vector<LostEntry> lost_entries_;
  std::unordered_set<std::uint64_t> older_states_;  // of what lost entries named: hashes in all pages
  std::vector<LostPage> lost_pages_;
  std::uint64_t left_out_ = 0;                  // whole layers that the map does not get
  const FoundLayer* first_left_out_ = nullptr;  // by key
};

}  // namespace apgm::format

#pragma once

#include <optional>
#include <vector>

#include "apgm/core/source.hpp"
#include "block.hpp"
#include "index.hpp"
#include "input_file.hpp"
#include "layer_block.hpp"

namespace apgm::format {

/// Walks the index of one commit. All it is given outlives it.
class FileCursor final : public PatchCursor {
 public:
  /// @param end  where the commit's IndexRoot starts: what it names lies before
  FileCursor(const InputFile& file, const TypeTable& types, const Root& root, std::uint64_t end,
             std::optional<PatchRange> range)
      : file_(file), types_(types), root_(root), end_(end), range_(range) {}

  bool next(PatchInfo& out) override;

 private:
  bool next_page();
  void take_page(const fbs::PageRef& ref);

  const InputFile& file_;
  const TypeTable& types_;
  const Root& root_;
  std::uint64_t end_;
  std::optional<PatchRange> range_;
  std::size_t page_ = 0;
  std::size_t at_ = 0;
  std::vector<IndexEntry> entries_;
  std::vector<std::byte> buffer_;
};

/// A layer block that is the one the index names.
struct LoadedLayer {
  LayerBlock layer;
  Bytes body;
};

/// Reads the block of a layer; the result points into `buffer`.
/// @throws Error{kDamaged|kUnsupported} without a path where the block breaks a rule, {kUnreadable}
LoadedLayer read_layer(const InputFile& file, const LayerInfo& info, std::vector<std::byte>& buffer);

/// A buffer for `read_layer`, one for each thread.
std::vector<std::byte>& layer_buffer();

/// The same, as stored bytes.
void read_stored(const InputFile& file, const LayerInfo& info, StoredLayer& out);

}  // namespace apgm::format

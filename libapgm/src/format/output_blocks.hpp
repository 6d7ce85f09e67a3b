#pragma once

#include <optional>

#include "apgm/format/output_file.hpp"
#include "commit_writer.hpp"

namespace apgm::format {

/// Blocks into a file that appears whole or not at all.
struct OutputBlocks final : BlockOutput {
  void write(Bytes bytes) override { file->write(bytes); }
  std::uint64_t size() const override { return file->size(); }
  std::optional<OutputFile> file;  ///< set before the first block
};

}  // namespace apgm::format

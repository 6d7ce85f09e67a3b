#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apgm/core/frame.hpp"

namespace apgm {

/// One thing that is wrong with a file.
struct Problem {
  std::string text;                 ///< "patch (17,-3) layer 'occupancy': a block fails its checksum"
  std::uint64_t offset = 0;         ///< byte in the file
  std::optional<PatchIndex> patch;  ///< where it concerns one
  std::string layer;                ///< name of its type; empty: none, or not known
};

struct VerifyOptions {
  bool deep = false;                          ///< decode every layer too, and check its cells
  int threads = 0;                            ///< 0: all cores
  std::size_t max_problems = 1000;            ///< that are told of; all are counted
  std::uint64_t max_memory_bytes = 0;         ///< 0: no bound but the number of blocks
  const std::atomic<bool>* cancel = nullptr;  ///< set: Error{kCancelled}
  std::function<void(std::uint64_t done, std::uint64_t total)> progress;  ///< bytes; from the caller's thread
};

struct VerifyReport {
  std::uint64_t file_bytes = 0;
  int version_major = 0;
  int version_minor = 0;
  bool archive = false;
  std::uint64_t commits = 0;         ///< whose footers were found, 1 in a sealed file
  std::uint64_t blocks = 0;          ///< that are whole
  std::uint64_t layers = 0;          ///< of these, Layer blocks
  std::uint64_t unknown_blocks = 0;  ///< of these, of kinds that this version skips
  std::uint64_t decoded_layers = 0;  ///< `deep` only
  std::uint64_t uncommitted_bytes =
      0;                            ///< after the last commit of an archive: an append that was interrupted
  std::string content_id;           ///< of the newest commit, 32 hex digits; empty: not known
  std::uint64_t problem_count = 0;  ///< what is torn is none
  std::vector<Problem> problems;    ///< by offset; the first max_problems that were met

  bool valid() const { return problem_count == 0 && uncommitted_bytes == 0; }
};

/// Reads the whole file and checks everything docs/format.md says of it (section 2.4), over all commits of an
/// archive. Goes on after a fault, so that one report names all. Every payload is hashed once, in the cache.
///
/// Guarantees: time linear in the file and the entries of each index, however many footers name it; memory:
/// some 150 bytes a block, and one layer a thread for `deep`; the same report for any number of threads.
/// @param path  a file, or "-" for standard input
/// @throws Error{kForeign} if it is no .apgm file, {kUnsupported} if nothing is wrong with it but that this
///         version cannot read it, {kLimit} if the budget does not hold the list of blocks, or for `deep` one
///         layer, {kUnreadable|kCancelled}
VerifyReport verify(const std::string& path, const VerifyOptions& options = {});
/// The same for a file's bytes in memory.
VerifyReport verify(std::span<const std::byte> bytes, const VerifyOptions& options = {});

}  // namespace apgm

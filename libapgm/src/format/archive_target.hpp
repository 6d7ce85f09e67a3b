#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "apgm/format/archive.hpp"
#include "append_file.hpp"
#include "commit_writer.hpp"
#include "commits.hpp"
#include "output_blocks.hpp"

namespace apgm::format {

/// The place in an archive that a commit goes to. Destroyed before `close`: the archive is as it was.
class CommitTarget : public BlockOutput {
 public:
  /// The commit this one follows; nullptr in a new archive.
  virtual const OpenCommit* base() const = 0;
  /// What `base` is read from.
  virtual const InputFile* input() const = 0;
  /// Makes what was written the last commit, on the disk. @throws Error{kOutput}
  virtual void close(Bytes footer) = 0;
};

/// @throws Error{kIncompatible} if the file is a sealed map; as read_preamble
Preamble check_is_archive(const InputFile& file);

/// What follows the last footer. Reads all of it.
TornEnd torn_end(const InputFile& file, const Tail& tail);

/// The end of an archive that is there. What lies after its last commit is cut off when the first is written.
class AppendTarget final : public CommitTarget {
 public:
  /// @param file  outlives it; `path` names it in messages
  /// @throws Error as Reader, {kIncompatible} if it is not an archive, {kUnsupported} if it may only be read
  AppendTarget(AppendFile& file, const std::string& path);
  ~AppendTarget() override;

  const OpenCommit* base() const override { return &*base_; }
  const InputFile* input() const override { return &*input_; }
  void write(Bytes bytes) override;
  /// Where the next block comes to lie.
  std::uint64_t size() const override { return ready_ ? file_.size() : base_->at.end(); }
  void close(Bytes footer) override;
  /// What lay after the last commit when the archive was opened.
  const TornEnd& torn() const { return torn_; }

 private:
  void make_ready();

  AppendFile& file_;
  std::optional<InputFile> input_;
  std::optional<OpenCommit> base_;
  TornEnd torn_;
  bool ready_ = false;
  bool dirty_ = false;
};

/// Replaces the header of the last commit by one with other tags; closes the target.
void write_tags(AppendTarget& target, const Tags& tags);

/// A commit that is only tried: what is written goes nowhere, and nothing is locked.
class TrialTarget final : public CommitTarget {
 public:
  /// Of an archive that is not there.
  TrialTarget();
  /// Of one that is. @throws Error as LockedFile and AppendTarget, but for locks
  explicit TrialTarget(const std::string& path);

  const OpenCommit* base() const override { return base_ ? &*base_ : nullptr; }
  const InputFile* input() const override { return input_ ? &*input_ : nullptr; }
  void write(Bytes bytes) override { size_ += bytes.size(); }
  std::uint64_t size() const override { return size_; }
  void close(Bytes /*footer*/) override {}
  /// As AppendTarget::torn.
  const TornEnd& torn() const { return torn_; }

 private:
  std::optional<InputFile> input_;
  std::optional<OpenCommit> base_;
  TornEnd torn_;
  std::uint64_t size_ = 0;
};

/// A new archive, which appears with its first commit.
class CreateTarget final : public CommitTarget {
 public:
  explicit CreateTarget(OutputFile file);
  /// @throws Error{kOutput} that says so if another made the file meanwhile, here and in `close`
  explicit CreateTarget(const std::string& path);

  const OpenCommit* base() const override { return nullptr; }
  const InputFile* input() const override { return nullptr; }
  void write(Bytes bytes) override { blocks_.write(bytes); }
  std::uint64_t size() const override { return blocks_.size(); }
  void close(Bytes footer) override;

 private:
  std::string path_;  // empty: not by its path
  OutputBlocks blocks_;
};

}  // namespace apgm::format

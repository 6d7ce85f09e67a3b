#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

namespace apgm::tools {

/// What a Progress counts.
enum class ProgressUnit : std::uint8_t { kPatches, kBytes };

/// One line on standard error that tells how far a long operation is: patches or bytes, rate, time left.
/// Appears after half a second, is drawn at most ten times a second, and is erased at the end.
class Progress {
 public:
  using Clock = std::chrono::steady_clock;
  using Write = std::function<void(const std::string&)>;

  /// @param label  what is being done: "merging"
  /// @param write  receives what goes to the terminal
  /// @param now    the time; a test passes its own
  Progress(std::string label, Write write, std::function<Clock::time_point()> now = Clock::now,
           ProgressUnit unit = ProgressUnit::kPatches);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void update(std::uint64_t done, std::uint64_t total);
  /// Removes the line, so that other text can be printed; the next update draws it again.
  void erase();

  /// The line for a state, without control characters.
  static std::string line(const std::string& label, std::uint64_t done, std::uint64_t total, double elapsed_s,
                          ProgressUnit unit = ProgressUnit::kPatches);

 private:
  std::string label_;
  Write write_;
  std::function<Clock::time_point()> now_;
  ProgressUnit unit_;
  Clock::time_point start_;
  Clock::time_point drawn_at_;
  bool visible_ = false;
};

}  // namespace apgm::tools

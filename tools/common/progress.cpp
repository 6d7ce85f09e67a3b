#include "tools/common/progress.hpp"

#include <fmt/format.h>

#include <utility>

#include "tools/common/json.hpp"

namespace apgm::tools {
namespace {

constexpr auto kDelay = std::chrono::milliseconds(500);
constexpr auto kInterval = std::chrono::milliseconds(100);
constexpr const char* kEraseLine = "\r\x1b[2K";

std::string duration_text(double seconds) {
  const auto s = static_cast<std::uint64_t>(seconds + 0.5);
  if (s < 60) return fmt::format("{} s", s);
  if (s < 3600) return fmt::format("{} min {:02} s", s / 60, s % 60);
  return fmt::format("{} h {:02} min", s / 3600, s / 60 % 60);
}

}  // namespace

Progress::Progress(std::string label, Write write, std::function<Clock::time_point()> now, ProgressUnit unit)
    : label_(std::move(label)),
      write_(std::move(write)),
      now_(std::move(now)),
      unit_(unit),
      start_(now_()),
      drawn_at_(start_) {}

Progress::~Progress() { erase(); }

void Progress::update(std::uint64_t done, std::uint64_t total) {
  const Clock::time_point time = now_();
  if (time - start_ < kDelay || (visible_ && time - drawn_at_ < kInterval)) return;
  visible_ = true;
  drawn_at_ = time;
  write_(kEraseLine + line(label_, done, total, std::chrono::duration<double>(time - start_).count(), unit_));
}

void Progress::erase() {
  if (!std::exchange(visible_, false)) return;
  write_(kEraseLine);
}

std::string Progress::line(const std::string& label, std::uint64_t done, std::uint64_t total,
                           double elapsed_s, ProgressUnit unit) {
  const bool bytes = unit == ProgressUnit::kBytes;
  const auto amount = [&](std::uint64_t n) { return bytes ? size_text(n) : count_text(n); };
  const std::string noun = bytes ? "" : " patches";
  const double rate = elapsed_s > 0 ? static_cast<double>(done) / elapsed_s : 0;
  std::string text = label + "  " + amount(done);
  if (total > 0) {
    text += fmt::format(" / {}{}  {} %", amount(total), noun, done * 100 / total);
  } else {
    text += noun;
  }
  text += fmt::format("  {}/s", amount(static_cast<std::uint64_t>(rate)));
  if (total > done && done > 0) {
    text += "  " + duration_text(static_cast<double>(total - done) / rate) + " left";
  }
  return text;
}

}  // namespace apgm::tools

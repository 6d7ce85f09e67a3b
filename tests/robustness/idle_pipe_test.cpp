#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <memory>
#include <thread>

#include "writers.hpp"

namespace apgm::test {
namespace {

using std::chrono::seconds;
using std::chrono::steady_clock;

/// A tool waits three seconds for the pipe before it ends itself; the rest is for a busy machine.
constexpr seconds kGrace{3}, kPatience{8};

/// A tool that reads the start of a map from a pipe whose other end stays open and silent.
class IdleReader {
 public:
  /// @param arguments  the tool's, in `shop`; one is "-"
  IdleReader(const Workshop& shop, const std::vector<std::string>& arguments) {
    const std::string pipe = pipes_ / "pipe";
    if (::mkfifo(pipe.c_str(), 0600) != 0) throw std::runtime_error("no pipe");
    end_ = ::open(pipe.c_str(), O_RDWR | O_CLOEXEC);  // neither end waits for the other
    const std::string start = read_file(shop.path("a.apgm")).substr(0, 1000);
    if (::write(end_, start.data(), start.size()) != static_cast<ssize_t>(start.size())) {
      throw std::runtime_error("the pipe takes nothing");
    }
    std::vector<std::string> line = arguments;
    line[0] = tool_path(line[0]);
    Launch launch;
    launch.directory = shop.directory();
    launch.input = pipe;
    launch.environment = {"TMPDIR=" + pipes_.path()};
    process_ = std::make_unique<Process>(line, launch);
  }
  ~IdleReader() { ::close(end_); }
  IdleReader(const IdleReader&) = delete;
  IdleReader& operator=(const IdleReader&) = delete;

  /// True once the tool has read what there was, so that it waits for more.
  bool waits() const {
    for (const auto end = steady_clock::now() + kPatience; steady_clock::now() < end;) {
      int left = 0;
      if (::ioctl(end_, FIONREAD, &left) == 0 && left == 0) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return false;
  }
  void signal(int number) {
    process_->signal(number);
    signalled_ = steady_clock::now();
  }
  /// All but the pipe that lies where temporary files go.
  std::size_t left_behind() const { return pipes_.list().size() - 1; }
  /// Exit code, and the time since the last signal. A tool that does not end gets the end of its input.
  std::pair<int, steady_clock::duration> outcome() {
    process_->wait_for_error_text("text that is never said", kPatience);
    const auto took = steady_clock::now() - signalled_;
    ::close(std::exchange(end_, -1));
    return {process_->wait().code, took};
  }

 private:
  TempDir pipes_;
  int end_ = -1;
  std::unique_ptr<Process> process_;
  steady_clock::time_point signalled_;
};

const std::vector<std::vector<std::string>>& readers() {
  static const std::vector<std::vector<std::string>> all{
      {"merge", "-O", "-", "b.apgm", "-o", "out.merge.apgm"},
      {"crop", "-O", "-", "--bbox", "1,1,30,30", "-o", "out.crop.apgm"},
      {"resample", "-O", "-", "--step", "5", "-o", "out.resample.apgm"},
      {"render", "-O", "-", "-o", "out.render.png"},
      {"convert", "-O", "-", "--level", "5", "-o", "out.convert.apgm"},
      {"convert", "-O", "-", "-o", "out.ot"},
  };
  return all;
}

class IdlePipeTest : public testing::Test {
 protected:
  IdlePipeTest() {
    for (const auto& line : readers()) write_file(shop_.path(line.back()), kOld);
    before_ = shop_.names();
  }

  /// All tools at once, since each takes its seconds.
  std::vector<std::unique_ptr<IdleReader>> waiting() const {
    std::vector<std::unique_ptr<IdleReader>> all;
    for (const auto& line : readers()) all.push_back(std::make_unique<IdleReader>(shop_, line));
    for (const auto& reader : all) EXPECT_TRUE(reader->waits());
    return all;
  }

  void expect_nothing_changed() const {
    EXPECT_THAT(shop_.names(), testing::UnorderedElementsAreArray(before_));
    for (const auto& line : readers()) EXPECT_EQ(read_file(shop_.path(line.back())), kOld);
  }

  void SetUp() override {
#if defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "ThreadSanitizer holds signals back until a read returns";
#endif
  }

  static constexpr const char* kOld = "what was there before";
  Workshop shop_{2};
  std::vector<std::string> before_;
};

TEST_F(IdlePipeTest, ASignalEndsAToolThatWaits) {
  for (const int number : {SIGINT, SIGTERM}) {
    SCOPED_TRACE("signal " + std::to_string(number));
    const auto all = waiting();
    for (const auto& reader : all) reader->signal(number);
    for (std::size_t i = 0; i < all.size(); ++i) {
      const auto [code, took] = all[i]->outcome();
      EXPECT_EQ(code, 130) << readers()[i][0];
      EXPECT_LT(took, kPatience) << readers()[i][0];
      EXPECT_EQ(all[i]->left_behind(), 0u) << readers()[i][0];
    }
    expect_nothing_changed();
  }
}

TEST_F(IdlePipeTest, ASecondSignalDoesNotWait) {
  const auto all = waiting();
  for (const auto& reader : all) reader->signal(SIGINT);
  // Two signals that wait together count as one.
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  for (const auto& reader : all) reader->signal(SIGINT);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto [code, took] = all[i]->outcome();
    EXPECT_EQ(code, 130) << readers()[i][0];
    EXPECT_LT(took, kGrace) << readers()[i][0];
  }
  expect_nothing_changed();
}

}  // namespace
}  // namespace apgm::test

#include "converters/scans/byte_stream.hpp"

#include <bzlib.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <new>

#include "apgm/core/error.hpp"

namespace apgm::converters {
namespace {

constexpr std::size_t kRawBytes = std::size_t{1} << 16;
constexpr std::size_t kWindowBytes = std::size_t{1} << 18;

[[noreturn]] void fail(const std::string& path, const char* verb, int error) {
  throw Error(ErrorCode::kUnreadable,
              std::string("cannot ") + verb + " '" + path + "': " + std::strerror(error))
      .hint(error == ENOENT ? "check the name and the directory" : "")
      .at(path);
}

bool starts_packed(std::string_view head) {
  constexpr std::string_view kBlock = "\x31\x41\x59\x26\x53\x59", kEmpty = "\x17\x72\x45\x38\x50\x90";
  if (!head.starts_with("BZh") || head.size() < 10) return false;
  return head.substr(4).starts_with(kBlock) || head.substr(4).starts_with(kEmpty);
}

}  // namespace

struct ByteStream::Packed {
  bz_stream stream{};
  bool open = false;   // between the begin and the end of one of the streams
  bool ended = false;  // what follows the last one is none

  ~Packed() { close(); }
  void begin() {
    stream = {};
    if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) throw std::bad_alloc();
    open = true;
  }
  void close() {
    if (open) BZ2_bzDecompressEnd(&stream);
    open = false;
  }
};

ByteStream::ByteStream(const std::string& path, const std::atomic<bool>* cancel)
    : path_(path), cancel_(cancel), raw_(kRawBytes), window_(kWindowBytes) {
  constexpr std::size_t kHead = 10;
  file_ =
      path == "-" ? ::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0) : ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file_ < 0) fail(path, "open", errno);
  try {
    struct stat status {};
    if (::fstat(file_, &status) == 0 && S_ISREG(status.st_mode)) {
      stored_total_ = static_cast<std::uint64_t>(status.st_size);
    }
    while (raw_to_ < kHead && read_raw()) continue;
    if (starts_packed({raw_.data(), raw_to_})) packed_ = std::make_unique<Packed>();
  } catch (...) {
    ::close(file_);
    throw;
  }
}

ByteStream::~ByteStream() { ::close(file_); }

bool ByteStream::read_raw() {
  if (raw_from_ == raw_to_) raw_from_ = raw_to_ = 0;
  ssize_t got = -1;
  do {
    got = ::read(file_, raw_.data() + raw_to_, raw_.size() - raw_to_);
  } while (got < 0 && errno == EINTR);
  if (got < 0) fail(path_, "read", errno);
  raw_to_ += static_cast<std::size_t>(got);
  stored_done_ += static_cast<std::uint64_t>(got);
  return got > 0;
}

std::size_t ByteStream::copy_raw(char* out, std::size_t n) {
  if (raw_from_ == raw_to_ && !read_raw()) return 0;
  n = std::min(n, raw_to_ - raw_from_);
  std::copy_n(raw_.data() + raw_from_, n, out);
  raw_from_ += n;
  return n;
}

void ByteStream::fail_packed(const std::string& what) const {
  const std::uint64_t at = stored_done_ - (raw_to_ - raw_from_);
  throw Error(ErrorCode::kDamaged,
              "'" + path_ + "' is damaged: its bzip2 data " + what + " near byte " + std::to_string(at))
      .hint("bzip2recover saves the blocks that are whole")
      .at(path_, at);
}

bool ByteStream::stream_follows() {
  constexpr std::string_view kMagic = "BZh";
  if (raw_to_ - raw_from_ < kMagic.size()) {
    const auto at = [this](std::size_t i) { return raw_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::copy(at(raw_from_), at(raw_to_), raw_.begin());
    raw_to_ -= raw_from_;
    raw_from_ = 0;
    while (raw_to_ < kMagic.size() && read_raw()) continue;
  }
  return std::string_view(raw_.data() + raw_from_, raw_to_ - raw_from_).starts_with(kMagic);
}

std::size_t ByteStream::unpack(char* out, std::size_t n) {
  bz_stream& stream = packed_->stream;
  std::size_t made = 0;
  while (made == 0) {
    if (!packed_->open) {
      packed_->ended = packed_->ended || !stream_follows();
      if (packed_->ended) return 0;
      packed_->begin();
    }
    if (raw_from_ == raw_to_ && !read_raw()) fail_packed("ends early");
    stream.next_in = raw_.data() + raw_from_;
    stream.avail_in = static_cast<unsigned>(raw_to_ - raw_from_);
    stream.next_out = out;
    stream.avail_out = static_cast<unsigned>(n);
    const int result = BZ2_bzDecompress(&stream);
    raw_from_ = raw_to_ - stream.avail_in;
    made = n - stream.avail_out;
    if (result == BZ_MEM_ERROR) throw std::bad_alloc();
    if (result == BZ_STREAM_END) packed_->close();
    if (result != BZ_OK && result != BZ_STREAM_END) fail_packed("fails its check");
  }
  return made;
}

std::string_view ByteStream::peek(std::size_t least) {
  least = std::min(least, kMaxPeek);
  if (to_ - from_ < least) {
    if (cancel_ != nullptr && cancel_->load()) throw Error(ErrorCode::kCancelled, "stopped on request");
    std::copy(window_.begin() + static_cast<std::ptrdiff_t>(from_),
              window_.begin() + static_cast<std::ptrdiff_t>(to_), window_.begin());
    to_ -= from_;
    from_ = 0;
    if (window_.size() < least) window_.resize(kMaxPeek);
    while (to_ < least) {
      char* const out = window_.data() + to_;
      const std::size_t room = window_.size() - to_;
      const std::size_t got = packed_ ? unpack(out, room) : copy_raw(out, room);
      if (got == 0) break;
      to_ += got;
    }
  }
  return {window_.data() + from_, to_ - from_};
}

void ByteStream::skip(std::size_t n) {
  from_ += n;
  offset_ += n;
}

std::size_t ByteStream::read(char* out, std::size_t n) {
  std::size_t done = 0;
  while (done < n) {
    const std::string_view next = peek();
    if (next.empty()) break;
    const std::size_t some = std::min(n - done, next.size());
    std::copy_n(next.data(), some, out + done);
    skip(some);
    done += some;
  }
  return done;
}

}  // namespace apgm::converters

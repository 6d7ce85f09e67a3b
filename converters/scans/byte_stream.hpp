#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace apgm::converters {

/// The bytes of a file or of standard input ("-"), unpacked where they are bzip2 (by content; several streams
/// one after the other are one). Memory: one window, however much a packed file unpacks to.
class ByteStream {
 public:
  static constexpr std::size_t kMaxPeek = std::size_t{1} << 20;

  /// @param cancel  once set, peek and read throw Error{kCancelled}
  /// @throws Error{kUnreadable}
  explicit ByteStream(const std::string& path, const std::atomic<bool>* cancel = nullptr);
  ~ByteStream();
  ByteStream(const ByteStream&) = delete;
  ByteStream& operator=(const ByteStream&) = delete;

  const std::string& path() const { return path_; }
  /// The bytes that come next: at least `least` (up to kMaxPeek) unless the end comes first. Valid until the
  /// next call. @throws Error{kUnreadable}, {kDamaged} where bzip2 data is damaged or ends early
  std::string_view peek(std::size_t least = 1);
  /// Passes over `n` bytes that peek gave.
  void skip(std::size_t n);
  /// Copies up to `n` bytes, fewer only at the end.
  std::size_t read(char* out, std::size_t n);
  /// Unpacked bytes passed so far.
  std::uint64_t offset() const { return offset_; }
  /// Bytes of the file itself taken so far, and all of them; 0 where that is not known.
  std::uint64_t bytes_done() const { return stored_done_; }
  std::uint64_t bytes_total() const { return stored_total_; }

 private:
  struct Packed;
  /// Takes more of the file into raw_; false at its end.
  bool read_raw();
  std::size_t copy_raw(char* out, std::size_t n);
  /// True if another bzip2 stream comes next: anything else behind one is passed over, as bzcat does.
  bool stream_follows();
  std::size_t unpack(char* out, std::size_t n);
  [[noreturn]] void fail_packed(const std::string& what) const;

  std::string path_;
  const std::atomic<bool>* cancel_;
  int file_ = -1;
  std::uint64_t stored_done_ = 0, stored_total_ = 0, offset_ = 0;
  std::vector<char> raw_, window_;  // as stored, and unpacked; each with what is left between from and to
  std::size_t raw_from_ = 0, raw_to_ = 0, from_ = 0, to_ = 0;
  std::unique_ptr<Packed> packed_;
};

}  // namespace apgm::converters

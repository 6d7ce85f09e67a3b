#include "converters/numpy/npz_writer.hpp"

#include <zlib.h>

#include <new>

#include "apgm/core/error.hpp"

namespace apgm::converters {
namespace {

constexpr std::uint64_t kMostBytes = 0xfffffffe;  // beyond, ZIP needs its 64-bit records
constexpr int kLevel = 6;

/// Little-endian fields, one after the other.
class Record {
 public:
  Record& u16(std::uint64_t v) { return put(v, 2); }
  Record& u32(std::uint64_t v) { return put(v, 4); }
  Record& text(const std::string& t) {
    bytes_ += t;
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  Record& put(std::uint64_t v, int n) {
    for (int i = 0; i < n; ++i, v >>= 8) bytes_ += static_cast<char>(v & 0xff);
    return *this;
  }
  std::string bytes_;
};

}  // namespace

struct NpzWriter::Entry {
  std::string name;
  std::uint64_t offset = 0, bytes = 0, stored = 0;
  std::uint32_t crc = 0;

  /// The fields local headers and the directory share: versions, flags, method, date, checksum and sizes.
  Record& common(Record& r, bool compressed, bool sizes) const {
    constexpr unsigned kSizesFollow = 8, kFirstDate = 0x21;
    r.u16(20).u16(kSizesFollow).u16(compressed ? 8 : 0).u16(0).u16(kFirstDate);
    return r.u32(sizes ? crc : 0).u32(sizes ? stored : 0).u32(sizes ? bytes : 0).u16(name.size());
  }
};

struct NpzWriter::Deflater {
  Deflater() {
    // Raw deflate: ZIP has a frame of its own.
    if (deflateInit2(&stream, kLevel, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY) != Z_OK)
      throw std::bad_alloc();
  }
  ~Deflater() { deflateEnd(&stream); }
  Deflater(const Deflater&) = delete;
  Deflater& operator=(const Deflater&) = delete;

  z_stream stream{};
  std::vector<Bytef> out = std::vector<Bytef>(std::size_t{1} << 18);
};

NpzWriter::NpzWriter(OutputFile& file, bool compressed)
    : file_(file), compressed_(compressed), start_(file.size()) {}
NpzWriter::~NpzWriter() = default;

void NpzWriter::emit(const std::string& bytes) { file_.write(bytes); }

void NpzWriter::check_size(std::uint64_t bytes) const {
  if (bytes <= kMostBytes && file_.size() - start_ <= kMostBytes) return;
  throw Error(ErrorCode::kLimit, "the archive or an array in it would have more than 4 GiB")
      .hint("crop the map, choose a layer, or set a coarser step");
}

void NpzWriter::begin(const std::string& name) {
  Entry entry;
  entry.name = name;
  entry.offset = file_.size() - start_;
  entry.crc = static_cast<std::uint32_t>(crc32(0, nullptr, 0));
  Record r;
  r.u32(0x04034b50);
  entry.common(r, compressed_, false).u16(0).text(name);
  emit(r.bytes());
  entries_.push_back(std::move(entry));
  if (compressed_) deflater_ = std::make_unique<Deflater>();
}

void NpzWriter::write(std::span<const std::byte> bytes) {
  constexpr std::size_t kMostAtOnce = std::size_t{1} << 30;
  for (; bytes.size() > kMostAtOnce; bytes = bytes.subspan(kMostAtOnce)) write(bytes.first(kMostAtOnce));
  Entry& entry = entries_.back();
  entry.bytes += bytes.size();
  check_size(entry.bytes);
  const auto* data = reinterpret_cast<const Bytef*>(bytes.data());
  const auto size = static_cast<uInt>(bytes.size());
  // Without data crc32 would start anew.
  if (size > 0) entry.crc = static_cast<std::uint32_t>(crc32(entry.crc, data, size));
  if (!compressed_) {
    entry.stored += bytes.size();
    file_.write(bytes);
    return;
  }
  z_stream& z = deflater_->stream;
  z.next_in = const_cast<Bytef*>(data);
  z.avail_in = size;
  const int flush = bytes.empty() ? Z_FINISH : Z_NO_FLUSH;
  do {
    z.next_out = deflater_->out.data();
    z.avail_out = static_cast<uInt>(deflater_->out.size());
    deflate(&z, flush);
    const std::size_t made = deflater_->out.size() - z.avail_out;
    entry.stored += made;
    file_.write(std::as_bytes(std::span(deflater_->out).first(made)));
  } while (z.avail_out == 0);
}

void NpzWriter::end() {
  if (compressed_) write({});  // nothing more: the deflater ends its stream
  deflater_.reset();
  const Entry& entry = entries_.back();
  check_size(entry.stored);
  emit(Record().u32(0x08074b50).u32(entry.crc).u32(entry.stored).u32(entry.bytes).bytes());
}

void NpzWriter::finish() {
  const std::uint64_t offset = file_.size() - start_;
  for (const Entry& entry : entries_) {
    Record r;
    r.u32(0x02014b50).u16(20);
    entry.common(r, compressed_, true).u16(0).u16(0).u16(0).u16(0).u32(0).u32(entry.offset).text(entry.name);
    emit(r.bytes());
  }
  const std::uint64_t bytes = file_.size() - start_ - offset;
  check_size(0);
  emit(Record()
           .u32(0x06054b50)
           .u16(0)
           .u16(0)
           .u16(entries_.size())
           .u16(entries_.size())
           .u32(bytes)
           .u32(offset)
           .u16(0)
           .bytes());
}

}  // namespace apgm::converters

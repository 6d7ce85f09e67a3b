#include "codec_body.hpp"

#include <memory>
#include <new>

#define ZSTD_STATIC_LINKING_ONLY  // for the estimate of memory
#include <zstd.h>

namespace apgm::format {

void fail_body(const char* what) { throw Error(ErrorCode::kDamaged, what); }

Scratch& scratch() {
  thread_local Scratch s;
  return s;
}

void join_planes(Bytes high, Bytes low, std::size_t n, int width, int raw_planes, std::uint32_t* values) {
  const auto plane = [&](int k) {
    return k >= raw_planes ? high.data() + static_cast<std::size_t>(width - 1 - k) * n
                           : low.data() + static_cast<std::size_t>(raw_planes - 1 - k) * n;
  };
  const auto at = [](const std::byte* p, std::size_t i) { return static_cast<std::uint32_t>(p[i]); };
  if (width == 4) {
    const std::byte* const planes[4] = {plane(0), plane(1), plane(2), plane(3)};
    kernels().join(planes, n, values);
  } else if (width == 2) {
    const std::byte *p1 = plane(1), *p0 = plane(0);
    for (std::size_t i = 0; i < n; ++i) values[i] = at(p1, i) << 8 | at(p0, i);
  } else {
    const std::byte* p0 = plane(0);
    for (std::size_t i = 0; i < n; ++i) values[i] = at(p0, i);
  }
}

void keep_smaller(Encoding encoding, std::span<const std::uint32_t> head, bool with_frame_size, Bytes content,
                  Bytes raw, int level, StoredLayer& best) {
  const std::size_t head_bytes = head.size_bytes() + (with_frame_size ? sizeof(std::uint32_t) : 0);
  const std::span<std::byte> body = scratch().body.fit(head_bytes + frame_bound(content.size()));
  const std::size_t frame_bytes = write_frame(body.subspan(head_bytes), content, level);
  const std::size_t size = head_bytes + frame_bytes + raw.size();
  if (!best.bytes.empty() && best.bytes.size() <= size) return;
  std::memcpy(body.data(), head.data(), head.size_bytes());
  if (with_frame_size) {
    const auto stored = static_cast<std::uint32_t>(frame_bytes);
    std::memcpy(body.data() + head.size_bytes(), &stored, sizeof(stored));
  }
  best.encoding = static_cast<std::uint8_t>(encoding);
  best.bytes.clear();
  best.bytes.reserve(size);
  best.bytes.insert(best.bytes.end(), body.begin(),
                    body.begin() + static_cast<std::ptrdiff_t>(head_bytes + frame_bytes));
  best.bytes.insert(best.bytes.end(), raw.begin(), raw.end());
}

std::size_t frame_bound(std::size_t content_bytes) { return ZSTD_compressBound(content_bytes); }

std::size_t write_frame(std::span<std::byte> room, Bytes content, int level) {
  thread_local const std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> context(ZSTD_createCCtx(),
                                                                                  &ZSTD_freeCCtx);
  if (context == nullptr) throw std::bad_alloc();
  const std::size_t n =
      ZSTD_compressCCtx(context.get(), room.data(), room.size(), content.data(), content.size(), level);
  if (ZSTD_isError(n)) throw Error(ErrorCode::kLimit, std::string("zstd: ") + ZSTD_getErrorName(n));
  return n;
}

std::size_t append_frame(std::vector<std::byte>& out, Bytes content, int level) {
  const std::size_t start = out.size();
  out.resize(start + frame_bound(content.size()));
  const std::size_t n = write_frame(std::span(out).subspan(start), content, level);
  out.resize(start + n);
  return n;
}

std::uint64_t frame_memory(std::uint64_t content_bytes, int level) {
  return ZSTD_estimateCCtxSize_usingCParams(ZSTD_getCParams(level, content_bytes, 0));
}

void read_frame(Bytes frame, std::span<std::byte> out) {
  thread_local const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(),
                                                                                  &ZSTD_freeDCtx);
  if (context == nullptr) throw std::bad_alloc();
  // zstd itself accepts several frames in a row and skips frames of application data: neither belongs here.
  if (frame.size() < 4 || read_as<std::uint32_t>(frame) != ZSTD_MAGICNUMBER)
    fail_body("a layer does not hold a zstd frame");
  if (ZSTD_getFrameContentSize(frame.data(), frame.size()) != out.size()) {
    fail_body("a zstd frame does not hold the size that follows from type, encoding and step");
  }
  const std::size_t frame_bytes = ZSTD_findFrameCompressedSize(frame.data(), frame.size());
  if (ZSTD_isError(frame_bytes) || frame_bytes != frame.size())
    fail_body("a zstd frame does not fill its place");
  const std::size_t n =
      ZSTD_decompressDCtx(context.get(), out.data(), out.size(), frame.data(), frame.size());
  if (ZSTD_isError(n) || n != out.size()) fail_body("a zstd frame cannot be decoded");
}

}  // namespace apgm::format

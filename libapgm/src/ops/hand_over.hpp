#pragma once

#include <algorithm>
#include <array>

#if defined(__SANITIZE_THREAD__)
extern "C" void __tsan_acquire(void* address);
extern "C" void __tsan_release(void* address);
#endif

namespace apgm::ops {

// TBB is not built with ThreadSanitizer, which therefore does not see how TBB hands work from thread to
// thread. These say what TBB promises, and no more, so that no report has to be suppressed. Nothing in other
// builds.

/// What happened before is seen by who receives the same address later.
inline void hand_over([[maybe_unused]] const void* address) {
#if defined(__SANITIZE_THREAD__)
  __tsan_release(const_cast<void*>(address));
#endif
}

inline void receive([[maybe_unused]] const void* address) {
#if defined(__SANITIZE_THREAD__)
  __tsan_acquire(const_cast<void*>(address));
#endif
}

/// One who holds an address at a time: received at the start, handed over at the end.
class Turn {
 public:
  explicit Turn(const void* address) : address_(address) { receive(address_); }
  ~Turn() { hand_over(address_); }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

 private:
  const void* address_;
};

/// Receives addresses when it ends, by an exception too.
struct AtEnd {
  std::array<const void*, 3> addresses;
  ~AtEnd() { std::ranges::for_each(addresses, receive); }
};

}  // namespace apgm::ops

#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>

namespace apgm::layouts {

/// What an allocation of `bytes` takes from the heap: a word of header, rounded up to 16 bytes, at least 32
/// (the chunk of the GNU C library's malloc). The same on every machine.
constexpr std::uint64_t heap_bytes(std::uint64_t bytes) {
  return bytes == 0 ? 0 : std::max<std::uint64_t>(32, (bytes + 8 + 15) / 16 * 16);
}

/// Adds up what a standard container really takes and gives back.
template <class T>
class CountingAllocator {
 public:
  using value_type = T;
  explicit CountingAllocator(std::uint64_t* bytes) : bytes_(bytes) {}
  template <class U>
  CountingAllocator(const CountingAllocator<U>& other) : bytes_(other.bytes()) {}

  T* allocate(std::size_t count) {
    T* memory = std::allocator<T>().allocate(count);
    *bytes_ += heap_bytes(count * sizeof(T));
    return memory;
  }
  void deallocate(T* memory, std::size_t count) {
    *bytes_ -= heap_bytes(count * sizeof(T));
    std::allocator<T>().deallocate(memory, count);
  }
  std::uint64_t* bytes() const { return bytes_; }
  friend bool operator==(const CountingAllocator& a, const CountingAllocator& b) {
    return a.bytes_ == b.bytes_;
  }

 private:
  std::uint64_t* bytes_;
};

}  // namespace apgm::layouts

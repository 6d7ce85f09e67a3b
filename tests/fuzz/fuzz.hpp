#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/core/source.hpp"
#include "temp_dir.hpp"

// What a fuzz target is made of: libFuzzer's interface, or that of driver.cpp.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace apgm::fuzz {

inline std::span<const std::byte> bytes_of(const std::uint8_t* data, std::size_t size) {
  return std::as_bytes(std::span(data, size));
}
inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// Ends the program: what was expected of the code under test does not hold.
[[noreturn]] void fail(const std::string& what);

/// A message says something. It may name what stands in the input, byte for byte: who prints it escapes it.
void check_text(const std::string& text);

/// Calls `work`, which may end in an Error that says something; whatever else it throws is a find.
/// @return  true if it did not throw
template <class Work>
bool survives(Work work) {
  try {
    work();
    return true;
  } catch (const Error& error) {
    check_text(error.message());
    if (!error.hint().empty()) check_text(error.hint());
    return false;
  }
}

/// Walks a source and loads its layers, 8192 patches and 32 MiB of values at most, so that no input is slow
/// for what it rightly holds.
void walk(const PatchSource& source);

/// The parts of an input that stands for several files: divided by lines "====".
std::vector<std::string_view> parts_of(std::string_view input);

/// A directory of the process, for readers that take names of files.
const test::TempDir& directory();
/// Writes a file there and gives its path.
std::string put(const std::string& name, std::string_view bytes);

}  // namespace apgm::fuzz

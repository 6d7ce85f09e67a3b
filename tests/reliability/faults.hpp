#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace apgm::test {

/// One thing that happens to the bytes of a file.
struct Fault {
  enum class Kind : std::uint8_t { kFlip, kTruncate, kZero, kSwap };
  Kind kind = Kind::kFlip;
  std::uint64_t a = 0;    ///< bit, size, or first byte of a run
  std::uint64_t b = 0;    ///< first byte of the other run
  std::uint64_t run = 0;  ///< bytes of a run
};

/// The faults of one kind that are tried on a file, and how they were picked.
struct FaultSet {
  std::string name;    ///< "single-bit flips"
  std::string choice;  ///< "all", "every 3rd", "2000 drawn with seed 1"
  std::vector<Fault> faults;
};

/// Every kind of fault on a file, at most `most` of a kind: all if there are no more, else drawn with a fixed
/// seed. Runs are pages of 4096 bytes; of 64 bytes in files of less than eight pages. Faults that change
/// nothing are left out.
std::vector<FaultSet> faults_for(const std::string& file, std::size_t most);

std::string with_fault(const std::string& file, const Fault& fault);

}  // namespace apgm::test

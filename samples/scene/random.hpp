#pragma once

#include <cstdint>
#include <random>

namespace apgm::samples {

/// Seeded noise with the same values everywhere: the engine is fixed by the C++ standard, its distributions
/// are not and stay unused.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  /// Uniform in [0, 1), 53 bits.
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }

  /// Bell-shaped with mean 0 and standard deviation 1, never beyond +-3.47: a sum of four uniforms.
  double bell() {
    double sum = 0;
    for (int i = 0; i < 4; ++i) sum += uniform();
    constexpr double kSqrt3 = 1.7320508075688772;
    return (sum - 2.0) * kSqrt3;
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace apgm::samples

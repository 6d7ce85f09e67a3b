#include "observe/parameters.hpp"

#include <array>
#include <charconv>

namespace apgm::observe {

std::string number_text(double value) {
  std::array<char, 40> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return {text.data(), end};
}

std::string Parameter::range() const {
  return "'" + std::string(key) + "' lies in " + (min_open ? "(" : "[") + number_text(min) + ", " +
         number_text(max) + (max_open ? ")" : "]");
}

std::string out_of_range(double value) { return "is " + number_text(value) + ", which is out of range"; }

std::vector<Parameter> parameters(Models& m) {
  constexpr bool kOpen = true, kClosed = false;
  constexpr double kFar_m = 10'000;  // no sensor reaches further; bounds what one beam can cost
  return {
      {"nuss", "occ_max", &m.nuss.occ_max, 0, 1, kClosed, kOpen},
      {"nuss", "sigma_m", &m.nuss.sigma_m, 0, kFar_m, kOpen, kClosed},
      {"nuss", "free_max", &m.nuss.free_max, 0, 1, kClosed, kOpen},
      {"nuss", "free_range_m", &m.nuss.free_range_m, 0, kFar_m, kOpen, kClosed},
      {"richter", "p_fn", &m.richter.p_fn, 0, 1, kOpen, kOpen},
      {"richter", "p_fp", &m.richter.p_fp, 0, 1, kOpen, kOpen},
      {"limits", "min_range_m", &m.limits.min_range_m, 0, kFar_m, kClosed, kClosed},
      {"limits", "max_range_m", &m.limits.max_range_m, 0, kFar_m, kOpen, kClosed},
      {"limits", "no_return_clears_m", &m.limits.no_return_clears_m, 0, kFar_m, kClosed, kClosed},
      {"limits", "z_min_m", &m.limits.z_min_m, -kFar_m, kFar_m, kClosed, kClosed},
      {"limits", "z_max_m", &m.limits.z_max_m, -kFar_m, kFar_m, kClosed, kClosed},
      {"camera", "rho", &m.camera.rho, 0, 1, kOpen, kOpen},
      {"camera", "max_range_m", &m.camera.max_range_m, 0, kFar_m, kOpen, kClosed},
  };
}

}  // namespace apgm::observe

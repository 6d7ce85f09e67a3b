#include "converters/geotiff/cell_rule.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "converters/common/belief.hpp"
#include "converters/common/settings.hpp"

namespace apgm::converters {
namespace {

constexpr float kMassSlack = 1e-6f;  // as canonicalise

std::string shown(double v) { return std::isnan(v) ? "without data" : format_number(v); }

class MassRule final : public PixelRule {
 public:
  using PixelRule::PixelRule;

  Cell cell(std::span<const double> in, std::span<float> out, RasterTally& tally) const override {
    float sum = 0;
    bool nothing = true, valid = true, exact = true;
    std::size_t empty = 0;
    for (std::size_t c = 0; c < in.size(); ++c) {
      empty += std::isnan(in[c]);
      valid = valid && in[c] >= 0 && in[c] <= 1;
      out[c] = static_cast<float>(in[c]) + 0.0f;
      exact = exact && static_cast<double>(out[c]) == in[c];
      nothing = nothing && out[c] == type().background(static_cast<int>(c));
      sum += out[c];
    }
    if (empty == in.size()) return Cell::kNothing;
    if (!valid || sum > 1 + kMassSlack || (type().stores_omega() && sum < 1 - kMassSlack)) {
      return Cell::kInvalid;
    }
    tally.rounded += !exact;
    return nothing ? Cell::kNothing : Cell::kData;
  }

  std::string why(std::span<const double> in) const override {
    double sum = 0;
    for (std::size_t c = 0; c < in.size(); ++c) {
      const std::string band = "band " + std::to_string(bands()[c] + 1);
      if (std::isnan(in[c])) return band + " has no data where other bands have";
      if (!(in[c] >= 0 && in[c] <= 1)) return band + " is " + shown(in[c]) + ", no mass";
      sum += in[c];
    }
    return "the masses sum to " + shown(sum);
  }
};

class ClassRule final : public PixelRule {
 public:
  ClassRule(LayerType type, int band, Legend legend, float mass, std::optional<int> other)
      : PixelRule(std::move(type), {band}), legend_(std::move(legend)), mass_(mass), other_(other) {
    bytes_.fill(kUnnamed);
    for (const auto& [code, k] : legend_.codes) {
      if (code >= 0 && code < 256) bytes_[static_cast<std::size_t>(code)] = k;
    }
  }

  Cell cell(std::span<const double> in, std::span<float> out, RasterTally& tally) const override {
    if (std::isnan(in[0])) return Cell::kNothing;
    if (std::floor(in[0]) != in[0] || std::fabs(in[0]) > 0x1p53) return Cell::kInvalid;
    const auto code = static_cast<std::int64_t>(in[0]);
    int k = class_of(code);
    if (k == kUnnamed) {
      if (!other_) return Cell::kInvalid;
      ++tally.unnamed[code];
      k = *other_;
    }
    if (k == Legend::kUnknown) return Cell::kNothing;
    for (float& v : out) v = 0;
    out[static_cast<std::size_t>(k)] = mass_;
    if (type().stores_omega()) out.back() = 1.0f - mass_;
    return Cell::kData;
  }

  std::string why(std::span<const double> in) const override {
    return "band " + std::to_string(bands()[0] + 1) + " is " + shown(in[0]) +
           ", which the legend does not name";
  }

 private:
  static constexpr int kUnnamed = -2;

  int class_of(std::int64_t code) const {
    if (code >= 0 && code < 256) return bytes_[static_cast<std::size_t>(code)];
    const auto it = legend_.codes.find(code);
    return it == legend_.codes.end() ? kUnnamed : it->second;
  }

  Legend legend_;
  std::array<int, 256> bytes_;  ///< the codes most rasters have
  float mass_;
  std::optional<int> other_;
};

class ProbabilityRule final : public PixelRule {
 public:
  using PixelRule::PixelRule;

  Cell cell(std::span<const double> in, std::span<float> out, RasterTally& tally) const override {
    if (std::isnan(in[0])) return Cell::kNothing;
    if (!(in[0] >= 0 && in[0] <= 1)) return Cell::kInvalid;
    const Masses masses = masses_from_probability(in[0]);
    tally.even += masses == Masses{};
    if (masses == Masses{}) return Cell::kNothing;
    out[0] = masses.occupied;
    out[1] = masses.free;
    return Cell::kData;
  }

  std::string why(std::span<const double> in) const override {
    return "band " + std::to_string(bands()[0] + 1) + " is " + shown(in[0]) + ", no probability in 0..1";
  }
};

class ValueRule final : public PixelRule {
 public:
  using PixelRule::PixelRule;

  Cell cell(std::span<const double> in, std::span<float> out, RasterTally& tally) const override {
    bool nothing = true, exact = true, empty = true;
    for (std::size_t c = 0; c < in.size(); ++c) {
      if (std::isnan(in[c])) {
        out[c] = std::numeric_limits<float>::quiet_NaN();
        continue;
      }
      if (!fits(in[c])) return Cell::kInvalid;
      empty = false;
      out[c] = static_cast<float>(in[c]) + 0.0f;
      exact = exact && static_cast<double>(out[c]) == in[c];
      nothing = nothing && out[c] == type().background(static_cast<int>(c));
    }
    tally.rounded += !exact;
    return empty || nothing ? Cell::kNothing : Cell::kData;
  }

  std::string why(std::span<const double> in) const override {
    std::size_t c = 0;
    while (c + 1 < in.size() && (std::isnan(in[c]) || fits(in[c]))) ++c;
    return "band " + std::to_string(bands()[c] + 1) + " is " + shown(in[c]) + ", no finite float32";
  }

 private:
  static bool fits(double v) {
    return std::fabs(v) <= static_cast<double>(std::numeric_limits<float>::max());
  }
};

}  // namespace

std::unique_ptr<PixelRule> mass_rule(LayerType type, std::vector<int> bands) {
  return std::make_unique<MassRule>(std::move(type), std::move(bands));
}

std::unique_ptr<PixelRule> class_rule(LayerType type, int band, Legend legend, float mass,
                                      std::optional<int> other) {
  return std::make_unique<ClassRule>(std::move(type), band, std::move(legend), mass, other);
}

std::unique_ptr<PixelRule> probability_rule(LayerType type, int band) {
  return std::make_unique<ProbabilityRule>(std::move(type), std::vector<int>{band});
}

std::unique_ptr<PixelRule> value_rule(LayerType type, std::vector<int> bands) {
  return std::make_unique<ValueRule>(std::move(type), std::move(bands));
}

}  // namespace apgm::converters

#include "fuse/regrid_cells.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>

#include "apgm/core/portable_math.hpp"
#include "fuse/evidence.hpp"

namespace apgm::fuse {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
/// Covered to this share, a target cell counts as covered: what is missing is rounding.
constexpr double kCovered = 1.0 - 1e-6;

/// {O, F}: lambda = -ln(1 - m(O)) is extensive; how the free mass pools is the policy's.
class OccupancyModel final : public CellModel {
 public:
  explicit OccupancyModel(Policy policy) : policy_(policy) {
    pools_ = {Pool::kExtensive, Pool::kIntensive};
    if (policy == Policy::kMin) pools_ = {Pool::kExtensive, Pool::kLeast, Pool::kIntensive};
    if (policy == Policy::kProduct) pools_ = {Pool::kExtensive, Pool::kExtensive, Pool::kIntensive};
  }

  bool measure(const float* m, double* v) const override {
    const double o = static_cast<double>(m[0]), f = static_cast<double>(m[1]);
    v[0] = o > 0 ? -portable::log1p(-o) : 0.0;
    switch (policy_) {
      case Policy::kExclusive:
        v[1] = f;
        break;
      case Policy::kProduct:
        v[1] = -portable::log(f);
        v[2] = 1;
        break;
      case Policy::kMin:
        v[2] = 1;
        [[fallthrough]];
      default:
        v[1] = o < 1 ? std::min(f / (1 - o), 1.0) : 0.0;
    }
    return (m[0] != 0.0f) | (m[1] != 0.0f);
  }

  void restore(const double* v, float* m) const override {
    m[0] = static_cast<float>(-portable::expm1(-v[0])) + 0.0f;  // not -0
    const float rest = 1.0f - m[0];
    const auto scaled = [&](double phi) { return rest * static_cast<float>(std::clamp(phi, 0.0, 1.0)); };
    switch (policy_) {
      case Policy::kExclusive:
        m[1] = m[0] > 0.0f ? 0.0f : scaled(v[1]);
        break;
      case Policy::kProduct:
        m[1] = v[2] >= kCovered ? std::min(rest, static_cast<float>(portable::exp(-v[1]))) : 0.0f;
        break;
      case Policy::kMin:
        m[1] = v[2] >= kCovered ? scaled(v[1]) : 0.0f;
        break;
      default:
        m[1] = scaled(v[1]);
    }
  }

 private:
  Policy policy_;
};

/// Singletons and Omega: lambda_k is extensive.
class EvidenceModel final : public CellModel {
 public:
  explicit EvidenceModel(std::size_t hypotheses) { pools_.assign(hypotheses, Pool::kExtensive); }

  bool measure(const float* m, double* v) const override {
    const std::size_t n = pools_.size();
    double sum = 0;
    for (std::size_t k = 0; k < n; ++k) sum += static_cast<double>(m[k]);
    if (!(sum > 0)) return false;
    const double share = evidence(sum, static_cast<double>(m[n])) / sum;
    for (std::size_t k = 0; k < n; ++k) v[k] = static_cast<double>(m[k]) * share;
    return true;
  }

  void restore(const double* v, float* m) const override {
    masses_from_evidence(v, pools_.size(), m, m[pools_.size()]);
  }
};

/// Masses pooled linearly over the area of the target, what is not covered being Omega.
class LinearModel final : public CellModel {
 public:
  LinearModel(std::size_t hypotheses, bool stores_omega) : hypotheses_(hypotheses) {
    pools_.assign(hypotheses + (stores_omega ? 1 : 0), Pool::kIntensive);
  }

  bool measure(const float* m, double* v) const override {
    bool data = false;
    for (std::size_t k = 0; k < pools_.size(); ++k) {
      v[k] = static_cast<double>(k < hypotheses_ ? m[k] : 1.0f - m[k]);
      data |= v[k] != 0;
    }
    return data;
  }

  void restore(const double* v, float* m) const override {
    float sum = 0;
    for (std::size_t k = 0; k < hypotheses_; ++k) {
      m[k] = std::clamp(static_cast<float>(v[k]), 0.0f, std::max(0.0f, 1.0f - sum));
      sum += m[k];
    }
    if (pools_.size() > hypotheses_)
      m[hypotheses_] = static_cast<float>(std::clamp(1.0 - v[hypotheses_], 0.0, 1.0));
  }

 private:
  std::size_t hypotheses_;
};

/// Numbers: mean over the area that holds numbers, sum, least or greatest.
class RealModel final : public CellModel {
 public:
  RealModel(std::size_t channels, Policy policy) : channels_(channels), policy_(policy) {
    switch (policy) {
      case Policy::kSum:
        pools_.assign(channels, Pool::kExtensive);
        break;
      case Policy::kMinimum:
        pools_.assign(channels, Pool::kLeast);
        break;
      case Policy::kMaximum:
        pools_.assign(channels, Pool::kGreatest);
        break;
      default:  // value times weight, and the weight, of each channel
        pools_.assign(2 * channels, Pool::kIntensive);
    }
  }

  bool measure(const float* x, double* v) const override {
    bool data = false;
    for (std::size_t c = 0; c < channels_; ++c) {
      const bool number = x[c] == x[c];
      const double value = static_cast<double>(x[c]);
      switch (policy_) {
        case Policy::kSum:
          v[c] = number ? value : 0.0;
          data |= v[c] != 0;
          break;
        case Policy::kMinimum:
          v[c] = number ? value : kInf;
          data |= number;
          break;
        case Policy::kMaximum:
          v[c] = number ? value : -kInf;
          data |= number;
          break;
        default:
          v[2 * c] = number ? value : 0.0;
          v[2 * c + 1] = number ? 1.0 : 0.0;
          data |= number;
      }
    }
    return data;
  }

  void restore(const double* v, float* x) const override {
    constexpr double kMost = std::numeric_limits<float>::max();
    for (std::size_t c = 0; c < channels_; ++c) {
      double value = 0;
      bool number = true;
      if (policy_ == Policy::kMean) {
        number = v[2 * c + 1] > 0;
        value = number ? v[2 * c] / v[2 * c + 1] : 0.0;
      } else {
        value = v[c];
        number = value > -kInf && value < kInf;
      }
      x[c] = number ? static_cast<float>(std::clamp(value, -kMost, kMost)) : kNan;
    }
  }

 private:
  static constexpr double kInf = std::numeric_limits<double>::infinity();
  std::size_t channels_;
  Policy policy_;
};

}  // namespace

std::unique_ptr<CellModel> CellModel::make(const LayerType& type) {
  if (!type.is_evidence()) return std::make_unique<RealModel>(type.channels.size(), type.policy);
  if (type.policy == Policy::kEvidence) return std::make_unique<EvidenceModel>(type.hypotheses.size());
  if (type.policy == Policy::kMean) {
    return std::make_unique<LinearModel>(type.hypotheses.size(), type.stores_omega());
  }
  return std::make_unique<OccupancyModel>(type.policy);
}

}  // namespace apgm::fuse

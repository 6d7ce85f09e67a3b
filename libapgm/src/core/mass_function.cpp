#include "apgm/core/mass_function.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

constexpr double kCellSlack = 2e-6;  // of float32 sums; canonicalise() allows 1e-6

[[noreturn]] void refuse(const char* what) { throw Error(ErrorCode::kInvalidArgument, what); }

std::size_t subsets_of(int hypotheses) {
  if (hypotheses < 1 || hypotheses > MassFunction::kMaxHypotheses) {
    throw Error(ErrorCode::kLimit,
                "a mass function has 1 to 8 hypotheses, not " + std::to_string(hypotheses));
  }
  return std::size_t{1} << hypotheses;
}

bool is_share(double v) { return v >= 0 && v <= 1; }

void check_frames(std::span<const MassFunction> inputs) {
  if (inputs.empty()) refuse("there are no mass functions to combine");
  for (const MassFunction& m : inputs) {
    if (m.hypotheses() != inputs[0].hypotheses()) {
      throw Error(ErrorCode::kIncompatible, "mass functions to combine have different frames");
    }
  }
}

/// Sum over B and C = A of m1(B) m2(C), by mask; [0] is the conflict met, with what m1 has there already.
std::vector<double> meet(std::span<const double> m1, std::span<const double> m2) {
  std::vector<double> out(m1.size(), 0.0);
  for (std::size_t b = 0; b < m1.size(); ++b) {
    if (m1[b] == 0) continue;
    for (std::size_t c = 0; c < m2.size(); ++c) out[b & c] += m1[b] * m2[c];
  }
  return out;
}

/// Masses of the non-empty subsets as a BBA. Those of one conjunction sum to 1 up to rounding.
MassFunction made_of(int hypotheses, std::span<const double> masses, double divisor) {
  std::vector<MassFunction::Focal> focal;
  for (std::size_t a = 1; a < masses.size(); ++a) {
    if (masses[a] > 0) focal.push_back({static_cast<Subset>(a), std::min(1.0, masses[a] / divisor)});
  }
  return MassFunction(hypotheses, focal);
}

}  // namespace

MassFunction::MassFunction(int hypotheses) : hypotheses_(hypotheses), masses_(subsets_of(hypotheses), 0.0) {
  masses_.back() = 1.0;
}

MassFunction::MassFunction(int hypotheses, std::span<const Focal> focal)
    : hypotheses_(hypotheses), masses_(subsets_of(hypotheses), 0.0) {
  double sum = 0;
  for (const Focal& f : focal) {
    check(f.set);
    if (!is_share(f.mass)) refuse("a mass lies in [0, 1]");
    if (f.set == 0 && f.mass != 0) refuse("the empty set has no mass");
    masses_[f.set] += f.mass;
    sum += f.mass;
  }
  if (!(std::abs(sum - 1) <= kSumTolerance)) refuse("the masses of a mass function sum to 1");
}

void MassFunction::check(Subset set) const {
  if ((set & ~frame()) != 0) refuse("a subset holds a hypothesis outside the frame");
}

double MassFunction::mass(Subset set) const {
  check(set);
  return masses_[set];
}

double MassFunction::bel(Subset set) const {
  check(set);
  double sum = 0;
  for (Subset b = 1; b <= frame(); ++b) sum += (b & ~set) == 0 ? masses_[b] : 0.0;
  return std::min(sum, 1.0);
}

double MassFunction::pl(Subset set) const {
  check(set);
  double sum = 0;
  for (Subset b = 1; b <= frame(); ++b) sum += (b & set) != 0 ? masses_[b] : 0.0;
  return std::min(sum, 1.0);
}

double MassFunction::betp(Subset set) const {
  check(set);
  double sum = 0;
  for (Subset b = 1; b <= frame(); ++b) sum += masses_[b] * std::popcount(b & set) / std::popcount(b);
  return std::min(sum, 1.0);
}

MassFunction MassFunction::discounted(double alpha) const {
  if (!is_share(alpha)) refuse("a discount factor lies between 0 and 1");
  MassFunction out = *this;
  for (double& m : out.masses_) m *= alpha;
  // 1 - alpha + alpha m, in the form that keeps m(Omega) = 1 exact.
  out.masses_.back() = 1 - alpha * (1 - masses_.back());
  return out;
}

std::vector<double> conjunction(std::span<const MassFunction> inputs) {
  check_frames(inputs);
  std::vector<double> out(inputs[0].masses().begin(), inputs[0].masses().end());
  for (const MassFunction& m : inputs.subspan(1)) out = meet(out, m.masses());
  return out;
}

Combined dempster_rule(std::span<const MassFunction> inputs) {
  check_frames(inputs);
  Combined out{inputs[0]};
  double agreement = 1;  // 1 - K of all so far
  for (const MassFunction& m : inputs.subspan(1)) {
    // Scaled and normalised at each fold: what little is left of much conflict does not underflow.
    std::vector<double> scaled(out.mass.masses().begin(), out.mass.masses().end());
    for (double& v : scaled) v *= 0x1p1000;
    const std::vector<double> met = meet(scaled, m.masses());
    const double left = std::accumulate(met.begin() + 1, met.end(), 0.0);
    if (left < std::numeric_limits<double>::min()) return {MassFunction(inputs[0].hypotheses()), 1.0, true};
    agreement *= left / (left + met[0]);
    out.mass = made_of(inputs[0].hypotheses(), met, left);
  }
  out.conflict = std::clamp(1 - agreement, 0.0, 1.0);
  return out;
}

Combined yager_rule(std::span<const MassFunction> inputs) {
  std::vector<double> met = conjunction(inputs);
  const double sum = std::accumulate(met.begin(), met.end(), 0.0);
  const bool total = std::accumulate(met.begin() + 1, met.end(), 0.0) == 0;
  const double conflict = total ? 1.0 : std::min(1.0, met[0] / sum);
  met.back() += std::exchange(met[0], 0.0);
  return {made_of(inputs[0].hypotheses(), met, sum), conflict, total};
}

MassFunction mass_function_at(const Layer& layer, const LayerType& type, CellIndex cell) {
  if (!type.is_evidence()) refuse("a layer of numbers holds no masses");
  assert(layer.channels() == static_cast<int>(type.channels.size()));
  const int n = static_cast<int>(type.hypotheses.size());
  const Subset omega = static_cast<Subset>(subsets_of(n) - 1);
  if (cell.a < 0 || cell.b < 0 || cell.a >= layer.side() || cell.b >= layer.side()) {
    refuse("a cell lies outside its layer");
  }
  double sum = 0;
  std::vector<MassFunction::Focal> focal;
  for (int c = 0; c < layer.channels(); ++c) {
    focal.push_back({c < n ? Subset{1} << c : omega, static_cast<double>(layer.at(c, cell))});
    if (!is_share(focal.back().mass)) refuse("a mass lies in [0, 1]");
    sum += focal.back().mass;
  }
  if (!(sum <= 1 + kCellSlack) || (type.stores_omega() && sum < 1 - kCellSlack)) {
    refuse("the masses of a cell do not sum to 1");
  }
  if (!type.stores_omega()) focal.push_back({omega, std::max(0.0, 1 - sum)});
  if (!type.stores_omega() && sum <= 1) sum = 1;
  for (auto& f : focal) f.mass /= sum;
  return MassFunction(n, focal);
}

}  // namespace apgm

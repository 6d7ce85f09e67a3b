#include "diff_cells.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "apgm/core/portable_math.hpp"

namespace apgm::ops {
namespace {

constexpr std::size_t kMaxChannels = 16;

/// One cell of evidence.
struct Belief {
  std::array<double, kMaxChannels> mass{};  ///< of the hypotheses
  double sum = 0;                           ///< of these
  std::size_t n = 0;

  /// BetP(h) = m(h) + m(Omega) / n, with m(Omega) = 1 - sum, whether stored or not: equal in both maps.
  double betp(std::size_t h) const { return mass[h] + std::max(0.0, 1.0 - sum) / static_cast<double>(n); }
  std::uint8_t state() const {
    std::size_t most = 0;
    bool alone = true;
    for (std::size_t h = 1; h < n; ++h) {
      if (mass[h] == mass[most]) alone = false;
      if (mass[h] > mass[most]) {
        most = h;
        alone = true;
      }
    }
    return alone ? static_cast<std::uint8_t>(CellDiff::kFirst + most) : CellDiff::kUndecided;
  }
};

double betp_delta(const Belief& p, const Belief& q) {
  double most = 0;
  for (std::size_t h = 0; h < p.n; ++h) most = std::max(most, std::fabs(p.betp(h) - q.betp(h)));
  return most;
}

/// KL(BetP || BetP') in nats; probabilities are taken up to kLeastProbability and brought to the sum 1.
double kl_divergence(const Belief& p, const Belief& q) {
  std::array<double, kMaxChannels> a{}, b{};
  double sum_a = 0, sum_b = 0;
  for (std::size_t h = 0; h < p.n; ++h) {
    sum_a += a[h] = std::max(kLeastProbability, p.betp(h));
    sum_b += b[h] = std::max(kLeastProbability, q.betp(h));
  }
  double kl = 0;
  for (std::size_t h = 0; h < p.n; ++h) {
    const double pa = a[h] / sum_a, pb = b[h] / sum_b;
    if (pa != pb) kl += pa * portable::log(pa / pb);
  }
  return std::max(0.0, kl);
}

/// sqrt(d^T D d / 2) with d = m - m' and D(A, B) = |A and B| / |A or B|. For singletons and Omega, where d
/// sums to 0, this is sqrt((sum d_h^2 + (sum d_h)^2 (1 - 2 / n)) / 2).
double jousselme(const Belief& p, const Belief& q) {
  double squares = 0, sum = 0;
  for (std::size_t h = 0; h < p.n; ++h) {
    const double d = p.mass[h] - q.mass[h];
    squares += d * d;
    sum += d;
  }
  const double omega = 1.0 - 2.0 / static_cast<double>(p.n);
  return std::sqrt(0.5 * (squares + sum * sum * omega));
}

/// K = sum of m(h) m'(k), h != k. Symmetric to the last bit.
double conflict(const Belief& p, const Belief& q) {
  double k = 0;
  for (std::size_t g = 0; g < p.n; ++g) {
    for (std::size_t h = 0; h < g; ++h) k += p.mass[g] * q.mass[h] + p.mass[h] * q.mass[g];
  }
  return std::min(1.0, k);
}

/// The planes of a layer, and what its cells mean.
class Cells {
 public:
  Cells(const Layer& layer, const LayerType& type)
      : n_(static_cast<std::size_t>(layer.channels())), hypotheses_(type.hypotheses.size()) {
    for (std::size_t c = 0; c < n_; ++c) {
      planes_[c] = layer.plane(static_cast<int>(c)).data();
      background_[c] = std::bit_cast<std::uint32_t>(type.background(static_cast<int>(c)));
    }
  }

  std::size_t channels() const { return n_; }
  float value(std::size_t channel, std::size_t i) const { return planes_[channel][i]; }
  std::uint32_t bits(std::size_t channel, std::size_t i) const {
    return std::bit_cast<std::uint32_t>(planes_[channel][i]);
  }
  bool known(std::size_t i) const {
    std::uint32_t other = 0;
    for (std::size_t c = 0; c < n_; ++c) other |= bits(c, i) ^ background_[c];
    return other != 0;
  }
  bool same(const Cells& o, std::size_t i) const {
    std::uint32_t other = 0;
    for (std::size_t c = 0; c < n_; ++c) other |= bits(c, i) ^ o.bits(c, i);
    return other == 0;
  }
  Belief belief(std::size_t i) const {
    Belief b;
    b.n = hypotheses_;
    for (std::size_t h = 0; h < hypotheses_; ++h) {
      b.mass[h] = static_cast<double>(planes_[h][i]);
      b.sum += b.mass[h];
    }
    return b;
  }
  /// The cell beside itself.
  CellDiff twice(std::size_t i) const {
    CellDiff cell;
    if (!known(i)) return cell;
    cell.before = cell.after = CellDiff::kUndecided;
    if (hypotheses_ == 0) return cell;
    const Belief b = belief(i);
    cell.before = cell.after = b.state();
    cell.conflict = static_cast<float>(::apgm::ops::conflict(b, b));
    return cell;
  }

 private:
  std::size_t n_, hypotheses_;
  std::array<const float*, kMaxChannels> planes_{};
  std::array<std::uint32_t, kMaxChannels> background_{};
};

/// |a - b|; no number beside a number is infinitely far, two of them are equal.
double distance(float a, float b) {
  if (std::isnan(a) || std::isnan(b)) {
    return std::isnan(a) && std::isnan(b) ? 0.0 : std::numeric_limits<double>::infinity();
  }
  return std::fabs(static_cast<double>(a) - static_cast<double>(b));
}

double greatest_distance(const Cells& a, const Cells& b, std::size_t i) {
  double most = 0;
  for (std::size_t c = 0; c < a.channels(); ++c)
    most = std::max(most, distance(a.value(c, i), b.value(c, i)));
  return most;
}

CellSums::Kind kind_of(const CellDiff& cell, const LayerType& type) {
  if (cell.before == CellDiff::kUnknown) return CellSums::kLearned;
  if (cell.after == CellDiff::kUnknown) return CellSums::kForgotten;
  const bool decided = cell.before >= CellDiff::kFirst && cell.after >= CellDiff::kFirst;
  if (!decided || cell.before == cell.after) return CellSums::kAdjusted;
  if (!type.is_occupancy()) return CellSums::kClassChanged;
  return cell.before == CellDiff::kFirst ? CellSums::kOccupiedToFree : CellSums::kFreeToOccupied;
}

/// Compares cells whose bits differ; counts are added at the end.
class Comparison {
 public:
  Comparison(const Layer& a, const Layer& b, const LayerType& type, std::optional<double> tolerance,
             CellSums& sums)
      : a_(a, type), b_(b, type), type_(type), tolerance_(tolerance), sums_(sums) {
    if (!type.is_evidence()) sums_.channels.resize(type.channels.size());
  }

  bool same(std::size_t i) const { return a_.same(b_, i); }
  bool known(std::size_t i) const { return a_.known(i); }

  /// A known cell of the same bits in both. Its conflict is what it holds in itself.
  CellDiff equal(std::size_t i) {
    if (!type_.is_evidence()) both(i);
    const CellDiff cell = a_.twice(i);
    if (type_.is_evidence()) sums_.conflict.add(static_cast<double>(cell.conflict));
    return cell;
  }

  /// A cell whose bits differ.
  CellDiff differing(std::size_t i) {
    CellDiff cell;
    const double most = greatest_distance(a_, b_, i);
    cell.differs = !tolerance_ || !(most <= *tolerance_);
    if (type_.is_evidence()) {
      sums_.max_mass_delta = std::max(sums_.max_mass_delta, most);
      beliefs(i, cell);
    } else {
      numbers(i, cell);
    }
    if (cell.differs) ++kinds[kind_of(cell, type_)];
    return cell;
  }

  std::array<std::uint64_t, 6> kinds{};

 private:
  void beliefs(std::size_t i, CellDiff& cell) {
    const Belief p = a_.belief(i), q = b_.belief(i);
    if (a_.known(i)) cell.before = p.state();
    if (b_.known(i)) cell.after = q.state();
    cell.conflict = static_cast<float>(conflict(p, q));
    sums_.conflict.add(static_cast<double>(cell.conflict));
    sums_.betp.add(betp_delta(p, q));
    sums_.jousselme.add(jousselme(p, q));
    sums_.kl += kl_divergence(p, q);
  }

  void numbers(std::size_t i, CellDiff& cell) {
    const bool before = a_.known(i), after = b_.known(i);
    cell.before = before ? CellDiff::kUndecided : CellDiff::kUnknown;
    cell.after = after ? CellDiff::kUndecided : CellDiff::kUnknown;
    if (before && after) both(i);
  }

  /// Of real channels: a cell that is known in both.
  void both(std::size_t i) {
    for (std::size_t c = 0; c < sums_.channels.size(); ++c) {
      if (std::isnan(a_.value(c, i)) || std::isnan(b_.value(c, i))) continue;
      ++sums_.channels[c].cells;
      sums_.channels[c].delta.add(distance(a_.value(c, i), b_.value(c, i)));
    }
  }

  Cells a_, b_;
  const LayerType& type_;
  std::optional<double> tolerance_;
  CellSums& sums_;
};

}  // namespace

CellTally Tally::over(const Frame& frame) const {
  const double cell_m = frame.cell_m(kMaxStep);
  return {cells, static_cast<double>(area) * (cell_m * cell_m)};
}

void CellSums::add(const CellSums& other) {
  compared.add(other.compared);
  for (std::size_t k = 0; k < kinds.size(); ++k) kinds[k].add(other.kinds[k]);
  betp.add(other.betp);
  jousselme.add(other.jousselme);
  conflict.add(other.conflict);
  max_mass_delta = std::max(max_mass_delta, other.max_mass_delta);
  kl += other.kl;
  channels.resize(std::max(channels.size(), other.channels.size()));
  for (std::size_t c = 0; c < other.channels.size(); ++c) {
    channels[c].cells += other.channels[c].cells;
    channels[c].delta.add(other.channels[c].delta);
  }
}

std::uint64_t CellSums::changed() const {
  std::uint64_t cells = 0;
  for (const Tally& kind : kinds) cells += kind.cells;
  return cells;
}

void CellSums::report(const Frame& frame, TypeDiff& out) const {
  out.compared = compared.over(frame);
  Tally all;
  for (const Tally& kind : kinds) all.add(kind);
  out.changed = all.over(frame);
  out.learned = kinds[kLearned].over(frame);
  out.forgotten = kinds[kForgotten].over(frame);
  out.free_to_occupied = kinds[kFreeToOccupied].over(frame);
  out.occupied_to_free = kinds[kOccupiedToFree].over(frame);
  out.class_changed = kinds[kClassChanged].over(frame);
  out.adjusted = kinds[kAdjusted].over(frame);
  if (out.type.is_evidence()) {
    out.betp_delta = betp.over(compared.cells);
    out.max_mass_delta = max_mass_delta;
    out.kl_divergence = kl;
    out.jousselme = jousselme.over(compared.cells);
    out.conflict = conflict.over(compared.cells);
    return;
  }
  out.channels.resize(out.type.channels.size());
  for (std::size_t c = 0; c < channels.size(); ++c) {
    out.channels[c] = {channels[c].cells, channels[c].delta.over(channels[c].cells)};
  }
}

void compare(const Layer& a, const Layer& b, const LayerType& type, std::optional<double> tolerance,
             CellSums& sums, const CellOutputs& outputs) {
  Comparison comparison(a, b, type, tolerance, sums);
  std::uint64_t compared = 0;
  for (std::size_t i = 0; i < a.cells(); ++i) {
    CellDiff cell;
    if (!comparison.same(i)) {
      ++compared;
      cell = comparison.differing(i);
      if (cell.differs && outputs.blocks != nullptr) {
        const auto place = static_cast<std::int32_t>(i);
        outputs.blocks->add({place & (a.side() - 1), place >> a.step()}, a.step());
      }
    } else if (comparison.known(i)) {
      ++compared;
      cell = comparison.equal(i);
    }
    if (outputs.cells != nullptr) outputs.cells[i] = cell;
  }
  sums.compared.add(compared, a.step());
  for (std::size_t k = 0; k < sums.kinds.size(); ++k) sums.kinds[k].add(comparison.kinds[k], a.step());
}

void describe_equal(const Layer& layer, const LayerType& type, CellDiff* out) {
  const Cells cells(layer, type);
  for (std::size_t i = 0; i < layer.cells(); ++i) out[i] = cells.twice(i);
}

}  // namespace apgm::ops

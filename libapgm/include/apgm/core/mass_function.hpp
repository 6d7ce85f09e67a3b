#pragma once

#include <cstdint>
#include <initializer_list>
#include <span>
#include <vector>

#include "apgm/core/layer.hpp"

namespace apgm {

/// A set of hypotheses of a frame, as a bit mask: bit k is hypothesis k. 0 is the empty set.
using Subset = std::uint32_t;

/// Evidence over the power set of a small frame Omega (paper, Sec. II-A: BBA m : 2^Omega -> [0, 1], m(empty)
/// = 0, masses sum to 1). Exact to double rounding and general, at 2^n doubles: for questions about single
/// cells, and what the float32 paths over whole layers (fuse) are checked against.
///
/// Subsets are passed as masks; every function that takes one throws Error{kInvalidArgument} if it has a bit
/// outside the frame.
class MassFunction {
 public:
  static constexpr int kMaxHypotheses = 8;
  /// By how much the sum of given masses may miss 1. They are kept as given.
  static constexpr double kSumTolerance = 1e-9;

  struct Focal {
    Subset set = 0;
    double mass = 0;
  };

  /// The vacuous BBA, m(Omega) = 1: the neutral element of Dempster's rule.
  /// @param hypotheses  |Omega|, 1 to kMaxHypotheses
  /// @throws Error{kLimit} for other numbers of hypotheses
  explicit MassFunction(int hypotheses);
  /// Masses of the sets named, all others 0. A set named twice gets the sum.
  /// @throws Error{kInvalidArgument} if a mass is not in [0, 1], the empty set has any, or the sum is not 1
  MassFunction(int hypotheses, std::span<const Focal> focal);
  MassFunction(int hypotheses, std::initializer_list<Focal> focal)
      : MassFunction(hypotheses, std::span<const Focal>(focal.begin(), focal.size())) {}

  int hypotheses() const { return hypotheses_; }
  /// Omega: all hypotheses.
  Subset frame() const { return (Subset{1} << hypotheses_) - 1; }
  /// m(A), in [0, 1].
  double mass(Subset set) const;
  /// Masses of all 2^n subsets, by mask.
  std::span<const double> masses() const { return masses_; }
  bool is_vacuous() const { return masses_.back() == 1.0; }

  /// Bel(A) = sum of m(B), B in A (paper, Sec. II-A): the pessimistic bound of P(A), in [0, 1].
  double bel(Subset set) const;
  /// Pl(A) = sum of m(B), B and A not disjoint, = 1 - Bel(not A): the optimistic bound, in [0, 1].
  double pl(Subset set) const;
  /// BetP(A) = sum of |A and B| / |B| m(B): the pignistic probability, Bel(A) <= BetP(A) <= Pl(A).
  double betp(Subset set) const;
  /// m^alpha (paper, Sec. II-A): masses times alpha, the rest to Omega; for a source reliable to `alpha`.
  /// @throws Error{kInvalidArgument} if alpha is not in [0, 1]
  MassFunction discounted(double alpha) const;

  friend bool operator==(const MassFunction&, const MassFunction&) = default;

 private:
  void check(Subset set) const;

  int hypotheses_;
  std::vector<double> masses_;  // by mask
};

/// What a rule of combination makes of several BBAs.
struct Combined {
  MassFunction mass;
  double conflict = 0;  ///< K of all inputs: the mass of their conjunction on the empty set, in [0, 1]
  bool total_conflict =
      false;  ///< nothing is left of the conjunction in double: the paper's rule is undefined
};

/// Dempster's rule (paper, Sec. II-A): sum of m1(B) m2(C), B and C = A, over 1 - K, for one or more BBAs.
/// Commutative and associative (to rounding); vacuous BBAs are neutral. K = 1 gives the vacuous BBA and says
/// so.
/// @throws Error{kIncompatible} if the frames differ in size; {kInvalidArgument} without inputs. So do all
/// rules
Combined dempster_rule(std::span<const MassFunction> inputs);

/// Yager's rule: the conjunction of all inputs at once, K is given to Omega. Commutative, not associative:
/// folding pairs gives something else. Total conflict gives the vacuous BBA, which is no special case here.
Combined yager_rule(std::span<const MassFunction> inputs);

/// The conjunction before any normalisation: masses of all 2^n subsets by mask, [0] is K. They sum to 1.
std::vector<double> conjunction(std::span<const MassFunction> inputs);

/// The masses of one cell of an evidence layer: singletons, the rest (or the stored m(Omega)) on Omega.
/// @param type  evidence with 2 to 8 hypotheses. A sum that rounding took off 1 is brought back to 1
/// @throws Error{kInvalidArgument} if `type` has no hypotheses, `cell` lies outside, or the cell's masses are
/// none
///         (see canonicalise()); {kLimit} for more than 8 hypotheses
MassFunction mass_function_at(const Layer& layer, const LayerType& type, CellIndex cell);

}  // namespace apgm

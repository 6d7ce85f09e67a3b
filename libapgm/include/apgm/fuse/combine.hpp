#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "apgm/core/layer.hpp"

namespace apgm {

/// How the cells of several layers become one.
enum class Rule : std::uint8_t {
  kDempster,  ///< Dempster's rule of combination (paper, Sec. III-A): the default
  kYager,     ///< conjunctive over all inputs, the whole conflict goes to Omega
  kMean,      ///< mean of the inputs that hold data in the cell
  kMax,       ///< the input with the greatest m(O) (occupancy) or the least m(Omega) (other frames)
  kLast,      ///< the last input that holds data in the cell; the only rule that depends on the order
};
std::string_view to_string(Rule rule);
std::optional<Rule> rule_from(std::string_view name);

struct CombineReport {
  std::uint64_t total_conflicts =
      0;  ///< cells with K = 1, where the paper's rule is undefined: they become vacuous
};

/// Combines layers of one type and one step cell by cell (paper, f_t; docs/theory.md, "Combination").
///
/// Guarantees: same bytes for any order of `inputs` (kLast excepted), any thread count and any ISA; masses
/// stay in [0, 1] and sum to at most 1 in float32. A cell that holds data in one input only is copied from it
/// bit by bit. One input is copied. Types of real channels: kDempster and kYager are taken as kMean.
///
/// @param inputs    1 or more layers of the same shape, all of `type`
/// @param out       receives the result; may be one of the inputs
/// @param conflict  nullptr, or cells() floats: receives K of each cell, 0 where fewer than two inputs hold
/// data
/// @throws Error{kIncompatible} if the shapes differ
CombineReport combine(std::span<const Layer* const> inputs, const LayerType& type, Rule rule, Layer& out,
                      float* conflict = nullptr);

/// Rows b of a layer, [begin, end): the touched part of a measurement.
struct RowRange {
  int begin = 0;
  int end = 0;
  bool empty() const { return end <= begin; }
  friend bool operator==(const RowRange&, const RowRange&) = default;
};

/// combine() on a band of rows alone: the same bits there, and no bit changes outside it. For fusing a
/// measurement into a map in place, at the cost of the rows it touched.
///
/// @param rows  within 0 .. side(); empty: nothing happens
/// @param out   one of the inputs, or a layer of their shape. Takes the newest stamp, its own among them; its
/// stated
///              error bound stays, a lone input's joins it
/// @return total conflicts in these rows
/// @throws Error{kIncompatible} if the shapes differ, also that of `out`; {kInvalidArgument} if `rows` leaves
/// the layer
CombineReport combine_rows(std::span<const Layer* const> inputs, const LayerType& type, Rule rule, Layer& out,
                           RowRange rows);

/// Discounts every cell in place (paper, m^alpha): masses times alpha, the rest to Omega. alpha in [0, 1].
/// Real channels are not changed.
void discount(Layer& layer, const LayerType& type, float alpha);

}  // namespace apgm

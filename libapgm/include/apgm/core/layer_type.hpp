#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace apgm {

/// How cells of a type are merged and split (docs/theory.md, "Resampling"). Stored in files by name.
enum class Policy : std::uint8_t {
  kExclusive,    ///< occupancy: free space is only measured in cells without occupied evidence
  kConditional,  ///< occupancy: free and occupied evidence may share a cell
  kMin,          ///< occupancy: least conditional free mass
  kProduct,      ///< occupancy: product of the free masses
  kMedian,       ///< occupancy: median, the paper's example; not level-consistent
  kDempster,     ///< occupancy: combine all cells by Dempster's rule; the paper's baseline only
  kEvidence,     ///< semantics: evidence (-ln m(Omega)) adds over area
  kMean,         ///< any: arithmetic mean; copy on split
  kSum,          ///< real channels: counts add; shared evenly on split
  kMinimum,      ///< real channels: least value; copy on split
  kMaximum,      ///< real channels: greatest value; copy on split
};
std::string_view to_string(Policy policy);
std::optional<Policy> policy_from(std::string_view name);

/// A height interval [z_min, z_max) in whole micrometres that all cells of a type stand for.
struct Slab {
  std::int64_t z_min_um = 0;
  std::int64_t z_max_um = 0;
  friend bool operator==(const Slab&, const Slab&) = default;
};

/// The value space of a layer's cells, as data: a user adds types without touching the library.
///
/// A type of evidence has hypotheses. Its channels are the masses of the singletons, in the order of the
/// hypotheses; with one channel more, the last is m(Omega), else Omega is implicit. Occupancy is {O, F} with
/// implicit Omega. A type without hypotheses has real channels (velocity, height, counts).
struct LayerType {
  std::string name;                     ///< [A-Za-z0-9_][A-Za-z0-9_.+-]*, at most 64 bytes
  std::vector<std::string> hypotheses;  ///< 0 or 2..15 names, same alphabet
  std::vector<std::string> channels;    ///< 1..16 names, same alphabet
  Policy policy = Policy::kConditional;
  std::optional<Slab> slab;  ///< nullopt: not tied to a height

  static LayerType occupancy(std::string name = "occupancy", Policy policy = Policy::kConditional);
  /// Singletons of `classes` and an explicit m(Omega) as last channel.
  static LayerType semantic(std::string name, std::vector<std::string> classes,
                            Policy policy = Policy::kEvidence);
  static LayerType real(std::string name, std::vector<std::string> channels, Policy policy = Policy::kMean);

  bool is_evidence() const { return !hypotheses.empty(); }
  /// {O, F} with implicit Omega: two channels.
  bool is_occupancy() const { return hypotheses.size() == 2 && channels.size() == 2; }
  /// Evidence with explicit m(Omega) in the last channel.
  bool stores_omega() const { return is_evidence() && channels.size() == hypotheses.size() + 1; }
  /// Value of `channel` in a cell without data: 0 for masses, 1 for m(Omega), 0 for counts (kSum), else quiet
  /// NaN.
  float background(int channel) const;

  /// Same name, hypotheses, channels and slab: layers of both can be fused. The policy may differ.
  bool same_space(const LayerType& other) const;
  /// Same background in every channel, bit by bit, so that cells which are not stored are alike. Both have
  /// the same channels.
  bool same_backgrounds(const LayerType& other) const;
  /// Same space and backgrounds: equal stored cells mean the same under both, and may stand under either.
  bool same_meaning(const LayerType& other) const { return same_space(other) && same_backgrounds(other); }
  /// @throws Error{kInvalidArgument} if a name, a count or the policy does not fit
  void check() const;

  friend bool operator==(const LayerType&, const LayerType&) = default;
};

/// Position of a type in the TypeTable of its map.
using TypeId = std::uint16_t;

/// The types of a map, sorted by name: ids follow from the names alone, in whatever order types were met.
class TypeTable {
 public:
  static constexpr std::size_t kMaxTypes = 4096;

  TypeTable() = default;
  /// Sorts, checks each type. @throws Error{kInvalidArgument} on two types of one name, {kLimit} on too many
  explicit TypeTable(std::vector<LayerType> types);

  std::size_t size() const { return types_.size(); }
  bool empty() const { return types_.empty(); }
  const LayerType& operator[](TypeId id) const { return types_[id]; }
  auto begin() const { return types_.begin(); }
  auto end() const { return types_.end(); }
  std::optional<TypeId> find(std::string_view name) const;
  friend bool operator==(const TypeTable&, const TypeTable&) = default;

 private:
  std::vector<LayerType> types_;
};

/// Where each type of `from` stands in `to`, matched by name.
/// @throws Error{kIncompatible} if `to` lacks one, or has it with another space or background
std::vector<TypeId> matching_ids(const TypeTable& from, const TypeTable& to);

}  // namespace apgm

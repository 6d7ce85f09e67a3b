#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apgm/core/layer_type.hpp"
#include "converters/geotiff/legend.hpp"

namespace apgm::converters {

/// What a pass over a raster met that a map cannot hold.
struct RasterTally {
  std::uint64_t even = 0;                         ///< probabilities of 0.5
  std::uint64_t rounded = 0;                      ///< values that are no float32
  std::uint64_t invalid = 0;                      ///< cells taken as unknown by invalid=unknown
  std::map<std::int64_t, std::uint64_t> unnamed;  ///< pixels by code that is not in the legend
};

/// How the values of a pixel become those of a cell. Thread-safe.
class PixelRule {
 public:
  enum class Cell : std::uint8_t { kNothing, kData, kInvalid };

  PixelRule(LayerType type, std::vector<int> bands) : type_(std::move(type)), bands_(std::move(bands)) {}
  virtual ~PixelRule() = default;
  const LayerType& type() const { return type_; }
  const std::vector<int>& bands() const { return bands_; }  ///< read, from 0

  /// @param in   a value for each of bands(), NaN without data
  /// @param out  a value for each channel; only set for kData
  virtual Cell cell(std::span<const double> in, std::span<float> out, RasterTally& tally) const = 0;
  /// Why `in` is kInvalid: "band 2 is 1.5, no mass".
  virtual std::string why(std::span<const double> in) const = 0;

 private:
  LayerType type_;
  std::vector<int> bands_;
};

/// Bands are the channels of a type of evidence. All without data: unknown; some: invalid.
std::unique_ptr<PixelRule> mass_rule(LayerType type, std::vector<int> bands);
/// A pixel is a code of the legend: its class gets `mass`, Omega the rest. What the legend does not name is
/// invalid, or with `other` belongs to that class (Legend::kUnknown: none) and is counted.
/// @param type  of evidence, whose hypotheses the legend numbers
std::unique_ptr<PixelRule> class_rule(LayerType type, int band, Legend legend, float mass,
                                      std::optional<int> other);
/// A pixel is the probability that the cell is occupied, in [0, 1]; the least committed belief of it.
std::unique_ptr<PixelRule> probability_rule(LayerType type, int band);
/// Bands are the channels of a real type.
std::unique_ptr<PixelRule> value_rule(LayerType type, std::vector<int> bands);

}  // namespace apgm::converters

#include "converters/geotiff/legend_file.hpp"

#include <array>

namespace apgm::converters {
namespace {

constexpr TiffColour kUnknown{132, 148, 168, 0};
constexpr TiffColour kOccupied{20, 20, 24, 255};
constexpr TiffColour kFree{250, 250, 246, 255};

// The palette of Okabe and Ito ("Color Universal Design", 2008); the second half repeats it darker.
constexpr std::array<TiffColour, 15> kClasses{{{86, 180, 233, 255},
                                               {240, 228, 66, 255},
                                               {213, 94, 0, 255},
                                               {0, 158, 115, 255},
                                               {204, 121, 167, 255},
                                               {0, 114, 178, 255},
                                               {230, 159, 0, 255},
                                               {0, 0, 0, 255},
                                               {43, 90, 116, 255},
                                               {120, 114, 33, 255},
                                               {106, 47, 0, 255},
                                               {0, 79, 57, 255},
                                               {102, 60, 83, 255},
                                               {0, 57, 89, 255},
                                               {115, 79, 0, 255}}};

}  // namespace

std::string legend_file_of(const std::string& tiff) { return tiff + ".aux.xml"; }

std::string legend_file(const LayerType& type) {
  std::string text =
      "<PAMDataset>\n  <PAMRasterBand band=\"1\">\n    <CategoryNames>\n      <Category>unknown</Category>\n";
  // Names of hypotheses hold nothing that XML would need escaped.
  for (const std::string& name : type.hypotheses) text += "      <Category>" + name + "</Category>\n";
  return text + "    </CategoryNames>\n  </PAMRasterBand>\n</PAMDataset>\n";
}

std::vector<TiffColour> class_colours(const LayerType& type) {
  if (type.is_occupancy()) return {kUnknown, kOccupied, kFree};
  std::vector<TiffColour> colours{kUnknown};
  for (std::size_t k = 0; k < type.hypotheses.size(); ++k) colours.push_back(kClasses[k]);
  return colours;
}

}  // namespace apgm::converters

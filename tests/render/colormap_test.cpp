#include <gtest/gtest.h>

#include <limits>

#include "apgm/ops/render.hpp"
#include "render_support.hpp"

namespace apgm {
namespace {

using namespace test;

TEST(ColormapTest, BeliefMixesTheThreeMasses) {
  Map map = occupancy_map();
  occupy(map, {0, 0}, 1, {0, 0}, 0.5f);
  release(map, {0, 0}, 1, {1, 0}, 0.5f);
  occupy(map, {0, 0}, 1, {0, 1}, 0.25f);
  release(map, {0, 0}, 1, {0, 1}, 0.5f);
  const Raster raster = render(map, {}).raster;
  EXPECT_EQ(raster.at(0, 1), (Colour{76, 84, 96}));
  EXPECT_EQ(raster.at(1, 1), (Colour{191, 199, 207}));
  EXPECT_EQ(raster.at(0, 0), (Colour{163, 167, 171}));
  EXPECT_EQ(raster.at(1, 0), kUnknown);
}

TEST(ColormapTest, EvidenceShowsFreeAndOccupiedInOneCell) {
  Map map = occupancy_map();
  occupy(map, {0, 0}, 1, {0, 0}, 1.0f);
  release(map, {0, 0}, 1, {1, 0}, 1.0f);
  occupy(map, {0, 0}, 1, {0, 1}, 0.5f);
  release(map, {0, 0}, 1, {0, 1}, 0.5f);
  RenderOptions options;
  options.colormap = Colormap::kEvidence;
  const Raster raster = render(map, options).raster;
  EXPECT_EQ(raster.at(0, 1), (Colour{213, 94, 0}));
  EXPECT_EQ(raster.at(1, 1), (Colour{0, 114, 178}));
  EXPECT_EQ(raster.at(0, 0), (Colour{240, 228, 66}));
  EXPECT_EQ(raster.at(1, 0), (Colour{236, 236, 236}));
}

TEST(ColormapTest, GreyIsThatOfNav2Maps) {
  Map map = occupancy_map();
  occupy(map, {0, 0}, 1, {0, 0}, 0.31f);
  release(map, {0, 0}, 1, {1, 0}, 0.51f);
  release(map, {0, 0}, 1, {0, 1}, 0.49f);
  RenderOptions options;
  options.colormap = Colormap::kGrey;
  const Raster raster = render(map, options).raster;
  EXPECT_EQ(raster.at(0, 1), (Colour{0, 0, 0}));
  EXPECT_EQ(raster.at(1, 1), (Colour{254, 254, 254}));
  EXPECT_EQ(raster.at(0, 0), (Colour{205, 205, 205}));
  EXPECT_EQ(raster.at(1, 0), (Colour{205, 205, 205}));
}

TEST(ColormapTest, CategoriesMixClassesByMass) {
  Map map(header_of({LayerType::semantic("semantic", {"Road", "Marking", "Blocked"})}));
  Layer& layer = map.layer({0, 0}, 0, 1);
  layer.at(0, {0, 0}) = 1.0f;
  layer.at(3, {0, 0}) = 0.0f;
  layer.at(2, {1, 0}) = 0.5f;
  layer.at(3, {1, 0}) = 0.5f;
  const Rendering r = render(map, {});
  EXPECT_EQ(r.raster.at(0, 1), (Colour{86, 180, 233}));
  EXPECT_EQ(r.raster.at(1, 1), (Colour{225, 165, 118}));
  EXPECT_EQ(r.raster.at(0, 0), (Colour{236, 236, 236}));
  ASSERT_EQ(r.legend.entries.size(), 4u);
  EXPECT_EQ(r.legend.entries[1], (LegendEntry{"Marking", {240, 228, 66}}));
}

TEST(ColormapTest, FifteenHypothesesHaveFifteenColours) {
  std::vector<std::string> classes;
  for (int i = 0; i < 15; ++i) classes.push_back("c" + std::to_string(i));
  Map map(header_of({LayerType::semantic("semantic", classes)}));
  const Rendering r = render(map, {});
  ASSERT_EQ(r.legend.entries.size(), 16u);
  for (std::size_t i = 0; i < 16; ++i) {
    for (std::size_t j = 0; j < i; ++j) EXPECT_NE(r.legend.entries[i].colour, r.legend.entries[j].colour);
  }
}

TEST(ColormapTest, RampSpansTheValuesDrawn) {
  Map map(header_of({LayerType::real("height", {"z", "age"})}));
  Layer& layer = map.layer({0, 0}, 0, 1);
  layer.at(0, {0, 0}) = -2.0f;
  layer.at(0, {1, 0}) = 6.0f;
  layer.at(0, {0, 1}) = std::numeric_limits<float>::infinity();
  const Rendering r = render(map, {});
  EXPECT_EQ(r.raster.at(0, 1), (Colour{68, 1, 84}));
  EXPECT_EQ(r.raster.at(1, 1), (Colour{253, 231, 37}));
  EXPECT_EQ(r.raster.at(0, 0), (Colour{214, 214, 214}));
  EXPECT_EQ(r.raster.at(1, 0), (Colour{214, 214, 214}));
  ASSERT_EQ(r.legend.scale.size(), 19u);
  EXPECT_EQ(r.legend.scale.front().label, "-2");
  EXPECT_EQ(r.legend.scale[9].label, "2");
  EXPECT_EQ(r.legend.scale.back(), (LegendEntry{"6", {253, 231, 37}}));
}

TEST(ColormapTest, RampOfOneValueAndOfNone) {
  Map map(header_of({LayerType::real("count", {"n"}, Policy::kSum)}));
  map.layer({0, 0}, 0, 1);
  EXPECT_TRUE(render(map, {}).legend.scale.empty());
  map.layer({0, 0}, 0, 1).at(0, {0, 0}) = 3.0f;
  const Rendering r = render(map, {});
  ASSERT_EQ(r.legend.scale.size(), 1u);
  EXPECT_EQ(r.legend.scale[0].label, "3");
  EXPECT_EQ(r.raster.at(0, 1), r.legend.scale[0].colour);
  EXPECT_EQ(r.raster.at(1, 1), (Colour{214, 214, 214}));
}

TEST(ColormapTest, RampOfExtremeValuesDoesNotOverflow) {
  Map map(header_of({LayerType::real("height", {"z"})}));
  Layer& layer = map.layer({0, 0}, 0, 1);
  layer.at(0, {0, 0}) = std::numeric_limits<float>::lowest();
  layer.at(0, {1, 0}) = std::numeric_limits<float>::max();
  layer.at(0, {0, 1}) = 0.0f;
  const Rendering r = render(map, {});
  EXPECT_EQ(r.raster.at(0, 1), (Colour{68, 1, 84}));
  EXPECT_EQ(r.raster.at(1, 1), (Colour{253, 231, 37}));
}

TEST(ColormapTest, NamesReadBack) {
  for (const auto map : {Colormap::kDefault, Colormap::kBelief, Colormap::kEvidence, Colormap::kGrey,
                         Colormap::kCategories, Colormap::kRamp}) {
    EXPECT_EQ(colormap_from(to_string(map)), map);
  }
  EXPECT_EQ(colormap_from("jet"), std::nullopt);
}

TEST(ColormapTest, RefusesAColormapThatDoesNotFit) {
  const auto code = [](LayerType type, Colormap colormap) {
    const Map map(header_of({std::move(type)}));
    RenderOptions options;
    options.colormap = colormap;
    return code_of([&] { (void)render(map, options); });
  };
  EXPECT_EQ(code(LayerType::occupancy(), Colormap::kRamp), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(LayerType::semantic("s", {"a", "b"}), Colormap::kBelief), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(LayerType::semantic("s", {"a", "b"}), Colormap::kGrey), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(LayerType::real("h", {"z"}), Colormap::kCategories), ErrorCode::kInvalidArgument);
}

TEST(ColormapTest, MassesOutOfRangeGiveSomeColour) {
  Map map = occupancy_map();
  Layer& layer = map.layer({0, 0}, 0, 1);
  layer.at(0, {0, 0}) = std::numeric_limits<float>::quiet_NaN();
  layer.at(0, {1, 0}) = 1e30f;
  layer.at(1, {0, 1}) = -1e30f;
  for (const auto colormap :
       {Colormap::kBelief, Colormap::kEvidence, Colormap::kGrey, Colormap::kCategories}) {
    RenderOptions options;
    options.colormap = colormap;
    EXPECT_EQ(render(map, options).raster.width, 2);
  }
}

}  // namespace
}  // namespace apgm

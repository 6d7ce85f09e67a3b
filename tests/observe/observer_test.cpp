#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "apgm/core/error.hpp"
#include "apgm/observe/model.hpp"
#include "scans.hpp"

namespace apgm {
namespace {

using test::always;
using test::frame_of_8_m;
using test::image_of;
using test::models_of;
using test::Random;
using test::random_scan;
using test::scan_of;
using test::uniform;

/// Masses of the cell that holds `p`; zeros if its patch was not observed.
struct Masses {
  float o = 0, f = 0;
};
Masses at(std::span<const ObservedLayer> layers, const Frame& frame, Point p) {
  for (const ObservedLayer& layer : layers) {
    const auto cell = frame.cell_at(p, layer.cells.step());
    if (cell.patch == layer.patch) return {layer.cells.at(0, cell.cell), layer.cells.at(1, cell.cell)};
  }
  return {};
}

TEST(ObserverTest, NussGivesTheClosedFormAlongABeam) {
  const Frame frame = frame_of_8_m();
  Observer observer(frame, models_of(ModelKind::kNuss));
  // Cells of 0.125 m. The return lies 0.0125 m off its cell's centre along x, in cell 32.
  const auto layers = observer.observe(scan_of({0.0625, 0.0625}, {{4.075, 0.0625}}), always(6));
  ASSERT_EQ(layers.size(), 1u);
  EXPECT_EQ(layers[0].patch, (PatchIndex{0, 0}));
  EXPECT_EQ(layers[0].rows, (RowRange{0, 1}));
  EXPECT_EQ(layers[0].cells.stamp_ns, 5);
  const Layer& cells = layers[0].cells;
  for (int a = 0; a < 32; ++a) {
    EXPECT_EQ(cells.at(0, {a, 0}), 0.0f);
    EXPECT_NEAR(cells.at(1, {a, 0}), 0.4 * (1 - 0.125 * a / 80), 1e-6) << a;
  }
  EXPECT_NEAR(cells.at(0, {32, 0}), 0.7 * std::exp(-0.0125 * 0.0125 / (2 * 0.1 * 0.1)), 1e-6);
  EXPECT_EQ(cells.at(1, {32, 0}), 0.0f);
  for (int a = 33; a < 64; ++a)
    EXPECT_EQ(cells.at(0, {a, 0}) + cells.at(1, {a, 0}), 0.0f) << "behind the hit";
}

TEST(ObserverTest, NussCombinesTheReturnsOfACell) {
  const Frame frame = frame_of_8_m();
  Observer observer(frame, models_of(ModelKind::kNuss));
  const Point centre{4.0625, 0.0625};
  const auto layers = observer.observe(scan_of({0.5, 0.0625}, {centre, centre, centre}), always(6));
  EXPECT_NEAR(at(layers, frame, centre).o, 1 - 0.3 * 0.3 * 0.3, 1e-6);
}

TEST(ObserverTest, NussNeverHoldsBothKindsOfEvidence) {
  const Frame frame = frame_of_8_m();
  Observer observer(frame, models_of(ModelKind::kNuss));
  Random random(1);
  for (int i = 0; i < 30; ++i) {
    const RangeScan scan = random_scan(random, 200, 12);
    const auto layers = observer.observe(scan, always(5));
    for (const ObservedLayer& layer : layers) {
      for (std::size_t k = 0; k < layer.cells.cells(); ++k) {
        ASSERT_TRUE(layer.cells.plane(0)[k] == 0 || layer.cells.plane(1)[k] == 0);
      }
    }
    for (const auto& beam : scan.beams) {
      if (!beam.hit) continue;
      const Masses m = at(layers, frame, beam.to);
      ASSERT_GT(m.o, 0.4f) << "a return left no obstacle";
      ASSERT_EQ(m.f, 0.0f);
    }
  }
}

TEST(ObserverTest, AReturnMakesItsCellOccupiedAtEveryStep) {
  const Frame frame = frame_of_8_m();
  Random random(2);
  for (int step = 0; step <= 10; ++step) {
    Observer observer(frame, models_of(ModelKind::kNuss));
    for (int i = 0; i < 40; ++i) {
      const Point p{uniform(random, -8, 8), uniform(random, -8, 8)};
      const Masses m = at(observer.observe(scan_of({0.1, 0.1}, {p}), always(step)), frame, p);
      const float bet_p = m.o + (1 - m.o - m.f) / 2;
      ASSERT_GE(m.o, 0.7 * std::exp(-0.5) - 1e-6) << "step " << step;
      ASSERT_GT(bet_p, 0.7f);
    }
  }
}

TEST(ObserverTest, BeamsWithoutReturnClearButTheirLastCell) {
  const Frame frame = frame_of_8_m();
  RangeScan scan = scan_of({0.5, 0.5}, {});
  scan.beams.push_back({scan.origin, {4.5, 0.5}, false});
  for (const ModelKind kind : {ModelKind::kNuss, ModelKind::kRichter}) {
    Observer observer(frame, models_of(kind));
    const auto layers = observer.observe(scan, always(3));
    for (const double x : {0.5, 1.5, 2.5, 3.5}) EXPECT_GT(at(layers, frame, {x, 0.5}).f, 0.1f);
    EXPECT_EQ(at(layers, frame, {4.5, 0.5}).f, 0.0f);
    EXPECT_EQ(at(layers, frame, {4.5, 0.5}).o, 0.0f);
  }
}

TEST(ObserverTest, NussFreeSpaceEndsAtItsRange) {
  const Frame frame = frame_of_8_m();
  Models models;
  models.nuss.free_range_m = 4;
  Observer observer(frame, models);
  const auto layers = observer.observe(scan_of({0.5, 0.5}, {{7.5, 0.5}}), always(3));
  EXPECT_NEAR(at(layers, frame, {3.5, 0.5}).f, 0.1, 1e-6);
  EXPECT_EQ(at(layers, frame, {4.5, 0.5}).f, 0.0f);
  EXPECT_EQ(at(layers, frame, {5.5, 0.5}).f, 0.0f);
}

TEST(ObserverTest, RichterGivesTheClosedForm) {
  const Frame frame = frame_of_8_m();
  Observer observer(frame, models_of(ModelKind::kRichter));
  // Cells of 1 m along a row: three beams, returns in cells 3, 3 and 5.
  const auto layers =
      observer.observe(scan_of({0.5, 0.5}, {{3.25, 0.5}, {3.75, 0.5}, {5.5, 0.5}}), always(3));
  const auto expect = [&](double x, double o, double f) {
    const Masses m = at(layers, frame, {x, 0.5});
    EXPECT_NEAR(m.o, o, 1e-7) << x;
    EXPECT_NEAR(m.f, f, 1e-7) << x;
  };
  expect(1.5, 0, 1 - 0.512);                        // T = 3
  expect(3.5, 0.8 * (1 - 0.01), 0.01 * (1 - 0.8));  // R = 2, T = 1
  expect(4.5, 0, 0.2);                              // T = 1
  expect(5.5, 0.9, 0);                              // R = 1
  expect(6.5, 0, 0);
}

TEST(ObserverTest, MassesAreValidForAnyNumberOfReturnsAndPassages) {
  const Frame frame = frame_of_8_m();
  for (const double p_fn : {1e-9, 0.1, 0.8, 1 - 1e-9}) {
    for (const double p_fp : {1e-9, 0.1, 0.9, 1 - 1e-9}) {
      Models models = models_of(ModelKind::kRichter);
      models.richter = {p_fn, p_fp};
      Observer observer(frame, models);
      for (const int returns : {0, 1, 2, 40, 5000}) {
        for (const int passages : {0, 1, 2, 40, 5000}) {
          std::vector<Point> ends(static_cast<std::size_t>(returns), {3.5, 0.5});
          ends.insert(ends.end(), static_cast<std::size_t>(passages), {5.5, 0.5});
          const Masses m = at(observer.observe(scan_of({0.5, 0.5}, ends), always(3)), frame, {3.5, 0.5});
          const double t = std::pow(p_fn, passages), r = std::pow(p_fp, returns);
          ASSERT_NEAR(m.o, t * (1 - r), 1e-6) << returns << " " << passages;
          ASSERT_NEAR(m.f, r * (1 - t), 1e-6) << returns << " " << passages;
          ASSERT_LE(m.o + m.f, 1.0f);
          ASSERT_LT(m.o, 1.0f);
          ASSERT_LT(m.f, 1.0f);
        }
      }
    }
  }
}

TEST(ObserverTest, GivesCanonicalLayersInKeyOrderWithDataInTheirRowsOnly) {
  const Frame frame = frame_of_8_m();
  Random random(3);
  for (const ModelKind kind : {ModelKind::kNuss, ModelKind::kRichter}) {
    Observer observer(frame, models_of(kind));
    const LayerType type = observer.models().occupancy_type();
    for (int i = 0; i < 20; ++i) {
      const auto layers = observer.observe(random_scan(random, 60, 30), always(5));
      ASSERT_FALSE(layers.empty());
      for (std::size_t k = 0; k < layers.size(); ++k) {
        ASSERT_TRUE(is_canonical(layers[k].cells, type));
        ASSERT_FALSE(is_vacuous(layers[k].cells, type));
        ASSERT_TRUE(k == 0 || curve_key(layers[k - 1].patch) < curve_key(layers[k].patch));
        for (int b = 0; b < layers[k].cells.side(); ++b) {
          if (b >= layers[k].rows.begin && b < layers[k].rows.end) continue;
          for (int a = 0; a < layers[k].cells.side(); ++a) {
            ASSERT_EQ(layers[k].cells.at(0, {a, b}), 0.0f);
            ASSERT_EQ(layers[k].cells.at(1, {a, b}), 0.0f);
          }
        }
      }
    }
  }
}

TEST(ObserverTest, ReusedMemoryChangesNothing) {
  const Frame frame = frame_of_8_m();
  Random random(4);
  for (const ModelKind kind : {ModelKind::kNuss, ModelKind::kRichter}) {
    Observer reused(frame, models_of(kind));
    for (int i = 0; i < 20; ++i) {
      const RangeScan scan = random_scan(random, 50, 25);
      const auto step_of = [i](PatchIndex p) -> std::optional<int> {
        if ((p.x + p.y + i) % 5 == 0) return {};
        return 3 + ((p.x ^ p.y ^ i) & 3);
      };
      Observer fresh(frame, models_of(kind));
      const auto a = reused.observe(scan, step_of), b = fresh.observe(scan, step_of);
      ASSERT_EQ(a.size(), b.size());
      for (std::size_t k = 0; k < a.size(); ++k) {
        ASSERT_EQ(a[k].patch, b[k].patch);
        ASSERT_EQ(a[k].rows, b[k].rows);
        ASSERT_TRUE(same_cells(a[k].cells, b[k].cells));
      }
    }
  }
}

TEST(ObserverTest, AsksForTheStepOfAPatchOnce) {
  Observer observer(frame_of_8_m(), {});
  Random random(5);
  std::map<PatchIndex, int> asked;
  observer.observe(random_scan(random, 100, 30), [&](PatchIndex p) -> std::optional<int> {
    ++asked[p];
    return p.x % 2 == 0 ? std::optional(4) : std::nullopt;
  });
  EXPECT_GT(asked.size(), 10u);
  for (const auto& [patch, times] : asked) EXPECT_EQ(times, 1);
}

TEST(ObserverTest, LeavesOutPatchesThatAreNotWanted) {
  const Frame frame = frame_of_8_m();
  Observer observer(frame, {});
  const auto layers = observer.observe(scan_of({0.5, 0.5}, {{20.5, 0.5}}), [](PatchIndex p) {
    return p.x == 1 ? std::nullopt : std::optional(3);
  });
  ASSERT_EQ(layers.size(), 2u);
  EXPECT_EQ(layers[0].patch, (PatchIndex{0, 0}));
  EXPECT_EQ(layers[1].patch, (PatchIndex{2, 0}));
  EXPECT_GT(at(layers, frame, {20.5, 0.5}).o, 0.4f);
}

TEST(ObserverTest, LayersThatEndWithoutDataAreLeftOut) {
  Models models;
  models.nuss.free_range_m = 3;
  Observer observer(frame_of_8_m(), models);
  RangeScan scan = scan_of({0.5, 0.5}, {});
  scan.beams.push_back({scan.origin, {20.5, 0.5}, false});
  const auto layers = observer.observe(scan, always(3));
  ASSERT_EQ(layers.size(), 1u);
  EXPECT_EQ(layers[0].patch, (PatchIndex{0, 0}));
}

TEST(ObserverTest, CountsBeamsItCannotUse) {
  Observer observer(frame_of_8_m(), {});
  const double nan = std::nan("");
  const auto layers = observer.observe(
      scan_of({0.5, 0.5}, {{nan, 0}, {0, HUGE_VAL}, {1e300, 0}, {1.5e6, 0}, {2, 2}}), always(3));
  EXPECT_EQ(layers.size(), 1u);
  EXPECT_EQ(observer.skipped().not_a_number, 2u);
  EXPECT_EQ(observer.skipped().outside, 2u);
  EXPECT_THROW(observer.observe(scan_of({nan, 0}, {}), always(3)), Error);
  EXPECT_THROW(observer.observe(scan_of({1e300, 0}, {}), always(3)), Error);
  EXPECT_THROW(observer.observe(scan_of({0, 0}, {{1, 1}}), always(12)), Error);
  EXPECT_EQ(observer.observe(scan_of({0.5, 0.5}, {{2, 2}}), always(3)).size(), 1u);
}

TEST(ObserverTest, WorksFarFromTheDatum) {
  Frame frame = frame_of_8_m();
  frame.datum_x_um = 570'000'000'000;
  frame.datum_y_um = 5'360'000'000'000;
  Observer here(frame_of_8_m(), {}), there(frame, {});
  Random random(6);
  RangeScan scan = random_scan(random, 100, 20);
  const auto a = here.observe(scan, always(6));
  const auto moved = [&](Point p) { return Point{p.x_m + 570'000, p.y_m + 5'360'000}; };
  scan.origin = moved(scan.origin);
  for (auto& beam : scan.beams) beam.from = moved(beam.from), beam.to = moved(beam.to);
  const auto b = there.observe(scan, always(6));
  ASSERT_EQ(a.size(), b.size());
  std::size_t differing = 0, cells = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    ASSERT_EQ(a[k].patch, b[k].patch);
    for (std::size_t i = 0; i < a[k].cells.cells(); ++i, ++cells) {
      differing += std::fabs(a[k].cells.plane(1)[i] - b[k].cells.plane(1)[i]) > 1e-6f;
    }
  }
  EXPECT_LE(differing, cells / 10'000) << "rounding to the nanometre may move a beam across a corner";
}

TEST(ObserverTest, PixelsGiveTheClosedForm) {
  Models models;
  models.camera.rho = 0.5;
  Observer observer(frame_of_8_m(), models);
  const Point p{2.5, 2.5};
  const auto layers =
      observer.observe(image_of({{p, 0}, {p, 0}, {p, 0}, {p, 1}, {{5.5, 2.5}, 2}}), always(3));
  ASSERT_EQ(layers.size(), 1u);
  EXPECT_EQ(layers[0].rows, (RowRange{2, 3}));
  EXPECT_EQ(layers[0].cells.stamp_ns, 9);
  const Layer& cells = layers[0].cells;
  const double known = 1 - std::pow(0.5, 4);
  EXPECT_NEAR(cells.at(0, {2, 2}), 0.75 * known, 1e-7);
  EXPECT_NEAR(cells.at(1, {2, 2}), 0.25 * known, 1e-7);
  EXPECT_EQ(cells.at(2, {2, 2}), 0.0f);
  EXPECT_NEAR(cells.at(3, {2, 2}), 1 - known, 1e-7);
  EXPECT_NEAR(cells.at(2, {5, 2}), 0.5, 1e-7);
  EXPECT_EQ(cells.at(3, {0, 0}), 1.0f);
  EXPECT_TRUE(is_canonical(cells, observer.models().semantic_type()));
}

TEST(ObserverTest, NoNumberOfPixelsIsCertain) {
  const Frame frame = frame_of_8_m();
  for (const double rho : {0.06, 0.9, 1 - 0x1p-53}) {
    Models models;
    models.camera.rho = rho;
    Observer observer(frame, models);
    for (const int kinds : {1, 2, 3}) {
      for (const int pixels : {1, 2, 20, 300, 20'000}) {
        LabelledGround image = image_of({});
        for (int i = 0; i < pixels; ++i) {
          image.pixels.push_back({{1, 1}, static_cast<std::uint8_t>(i % (kinds == 3 ? 3 : 7) % kinds)});
        }
        const auto layers = observer.observe(image, always(2));
        ASSERT_EQ(layers.size(), 1u);
        const Layer& cells = layers[0].cells;
        EXPECT_TRUE(is_canonical(cells, models.semantic_type()));
        const CellIndex at = frame.cell_at({1, 1}, 2).cell;
        double sum = 0;
        for (int c = 0; c < 4; ++c) {
          EXPECT_LE(cells.at(c, at), 1 - 0x1p-24) << rho << " " << pixels;
          sum += static_cast<double>(cells.at(c, at));
        }
        EXPECT_GE(cells.at(3, at), 0x1p-24f * 0.9999f) << rho << " " << pixels;
        EXPECT_NEAR(sum, 1, 1e-6);
      }
    }
  }
}

TEST(ObserverTest, KeepsToTheBytesOfAMeasurementAndGivesMemoryBack) {
  const Frame frame = frame_of_8_m();
  constexpr std::uint64_t kPatch = 2 * 4 * 32 * 32;
  Observer observer(frame, models_of(ModelKind::kNuss), 3 * kPatch),
      other(frame, models_of(ModelKind::kNuss));
  EXPECT_EQ(observer.observe(scan_of({1, 1}, {{20, 1}}), always(5)).size(), 3u);
  try {
    observer.observe(scan_of({1, 1}, {{30, 1}}), always(5));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kLimit);
  }
  Random random(4);
  for (const std::uint64_t kept : {std::uint64_t{0}, 2 * kPatch, 4 * kPatch, std::uint64_t{1} << 30}) {
    const RangeScan scan = scan_of({1, 1}, {{uniform(random, 2, 20), uniform(random, 1, 7)}});
    const auto a = observer.observe(scan, always(5)), b = other.observe(scan, always(5));
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) EXPECT_TRUE(same_cells(a[i].cells, b[i].cells));
    observer.trim(kept);
  }
}

TEST(ObserverTest, CountsPixelsItCannotUse) {
  Observer observer(frame_of_8_m(), {});
  const auto layers = observer.observe(
      image_of({{{1, 1}, 3}, {{std::nan(""), 1}, 0}, {{41, 0}, 0}, {{1e300, 0}, 0}, {{1, 1}, 2}}), always(3));
  EXPECT_EQ(layers.size(), 1u);
  EXPECT_EQ(observer.skipped().outside, 2u);
  EXPECT_EQ(observer.skipped().not_a_number, 1u);
  EXPECT_EQ(observer.skipped().no_return, 1u);
}

TEST(ModelsTest, TypesFollowTheModel) {
  EXPECT_EQ(models_of(ModelKind::kNuss).occupancy_type().policy, Policy::kExclusive);
  EXPECT_EQ(models_of(ModelKind::kRichter).occupancy_type().policy, Policy::kConditional);
  EXPECT_EQ(Models{}.semantic_type(), LayerType::semantic("semantics", {"Road", "Marking", "Blocked"}));
}

}  // namespace
}  // namespace apgm

#include "apgm/observe/ray.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <random>
#include <set>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

using Random = std::mt19937_64;
using Wide = __int128;

/// A cell anywhere in the grid.
struct Visit {
  PatchIndex patch;
  int step = 0;
  CellIndex cell;
  friend auto operator<=>(const Visit&, const Visit&) = default;
};

struct NanoPoint {
  std::int64_t x = 0, y = 0;  // from the datum
  friend bool operator==(const NanoPoint&, const NanoPoint&) = default;
};

/// Steps 0..`most` that differ from patch to patch, some patches without any.
struct PatchSteps {
  int most = 9;
  std::uint64_t seed = 0;
  bool gaps = true;
  std::optional<int> operator()(PatchIndex p) const {
    Random random(seed ^ curve_key(p));
    if (gaps && random() % 8 == 0) return {};
    return static_cast<int>(random() % static_cast<unsigned>(most + 1));
  }
};

Frame frame_of(std::int64_t edge_um, std::int64_t x_um = 0, std::int64_t y_um = 0) {
  Frame frame;
  frame.edge_um = edge_um;
  frame.datum_x_um = x_um;
  frame.datum_y_um = y_um;
  return frame;
}

Point metres(const Frame& frame, NanoPoint p) {
  return {static_cast<double>(p.x + frame.datum_x_um * 1000) / 1e9,
          static_cast<double>(p.y + frame.datum_y_um * 1000) / 1e9};
}

std::vector<Visit> walk(const Frame& frame, NanoPoint from, NanoPoint to, const StepOf& step_of) {
  std::vector<Visit> visits;
  int lasts = 0;
  std::set<PatchIndex> asked;
  RayWalker walker(frame);
  walker.walk(
      metres(frame, from), metres(frame, to),
      [&](PatchIndex p) {
        EXPECT_TRUE(asked.insert(p).second) << "a patch was asked for twice";
        return step_of(p);
      },
      [&](const RayRun& run, bool last) {
        EXPECT_FALSE(run.cells.empty());
        for (const CellIndex c : run.cells) visits.push_back({run.patch, run.step, c});
        lasts += last;
      });
  EXPECT_LE(lasts, 1);
  return visits;
}

/// A share of the segment, num / den, den > 0.
struct Share {
  Wide num, den;
  friend bool operator<(const Share& a, const Share& b) { return a.num * b.den < b.num * a.den; }
};

/// Shares of the segment in which one coordinate lies in [low, high), all in units of 2^-step nm; false if
/// none. For the cells that count, whether the borders belong to the interval does not matter but where d =
/// 0.
bool within(Wide from, Wide d, Wide low, Wide high, Share& begin, Share& end) {
  if (d == 0) return from >= low && from < high;
  const Share a = d > 0 ? Share{low - from, d} : Share{from - high, -d};
  const Share b = d > 0 ? Share{high - from, d} : Share{from - low, -d};
  if (begin < a) begin = a;
  if (b < end) end = b;
  return begin < end;
}

/// All cells of the patch by brute force: those with a piece of positive length, and those of the ends.
void cells_by_clipping(const Frame& frame, NanoPoint from, NanoPoint to, PatchIndex patch, int step,
                       std::vector<std::pair<double, Visit>>& out) {
  const Wide scale = Wide{1} << step, edge = Wide{frame.edge_um} * 1000;
  const auto meets = [&](CellIndex c, double& when) {
    Share begin{0, 1}, end{1, 1};
    const Wide x = (Wide{patch.x} * scale + c.a) * edge, y = (Wide{patch.y} * scale + c.b) * edge;
    const bool piece = within(from.x * scale, (Wide{to.x} - from.x) * scale, x, x + edge, begin, end) &&
                       within(from.y * scale, (Wide{to.y} - from.y) * scale, y, y + edge, begin, end) &&
                       !(from == to);
    const auto holds = [&](NanoPoint p) {
      return p.x * scale >= x && p.x * scale < x + edge && p.y * scale >= y && p.y * scale < y + edge;
    };
    when = holds(from) ? -1.0
           : holds(to) ? 2.0
                       : static_cast<double>(begin.num) / static_cast<double>(begin.den);
    return piece || holds(from) || holds(to);
  };
  for (std::int32_t b = 0; b < 1 << step; ++b) {
    for (std::int32_t a = 0; a < 1 << step; ++a) {
      double when = 0;
      if (meets({a, b}, when)) out.push_back({when, {patch, step, {a, b}}});
    }
  }
}

std::vector<Visit> by_clipping(const Frame& frame, NanoPoint from, NanoPoint to, const StepOf& step_of) {
  std::vector<std::pair<double, Visit>> found;
  const PatchIndex p = frame.patch_at(metres(frame, from)), q = frame.patch_at(metres(frame, to));
  for (std::int32_t y = std::min(p.y, q.y); y <= std::max(p.y, q.y); ++y) {
    for (std::int32_t x = std::min(p.x, q.x); x <= std::max(p.x, q.x); ++x) {
      if (const auto step = step_of({x, y})) cells_by_clipping(frame, from, to, {x, y}, *step, found);
    }
  }
  std::ranges::stable_sort(found, {}, [](const auto& f) { return f.first; });
  std::vector<Visit> visits;
  for (const auto& [when, visit] : found) visits.push_back(visit);
  return visits;
}

std::string show(const std::vector<Visit>& visits) {
  std::string text;
  for (const Visit& v : visits) {
    text += " (" + std::to_string(v.patch.x) + "," + std::to_string(v.patch.y) + ")/" +
            std::to_string(v.step) + ":" + std::to_string(v.cell.a) + "," + std::to_string(v.cell.b);
  }
  return text;
}

void expect_as_clipped(const Frame& frame, NanoPoint from, NanoPoint to, const StepOf& step_of) {
  const auto visits = walk(frame, from, to, step_of);
  const auto wanted = by_clipping(frame, from, to, step_of);
  ASSERT_EQ(visits, wanted) << "from " << from.x << "," << from.y << " to " << to.x << "," << to.y
                            << "\nwalked" << show(visits) << "\nwanted" << show(wanted);
  auto reverse = walk(frame, to, from, step_of);
  std::ranges::reverse(reverse);
  ASSERT_EQ(visits, reverse) << "reverse: from " << from.x << "," << from.y << " to " << to.x << "," << to.y;
}

std::int64_t between(Random& random, std::int64_t low, std::int64_t high) {
  return std::uniform_int_distribution<std::int64_t>(low, high)(random);
}

TEST(RayWalkerTest, VisitsExactlyTheCellsThatClippingFinds) {
  Random random(1);
  for (int i = 0; i < 1500; ++i) {
    const Frame frame = frame_of(between(random, 1'000, 20'000'000));
    const std::int64_t edge = frame.edge_um * 1000;
    const PatchSteps steps{5, static_cast<std::uint64_t>(i)};
    const auto point = [&] {
      return NanoPoint{between(random, -3 * edge, 3 * edge), between(random, -3 * edge, 3 * edge)};
    };
    SCOPED_TRACE("case " + std::to_string(i));
    ASSERT_NO_FATAL_FAILURE(expect_as_clipped(frame, point(), point(), steps));
  }
}

TEST(RayWalkerTest, VisitsExactlyTheCellsThatClippingFindsInFineLayers) {
  Random random(6);
  for (int i = 0; i < 12; ++i) {
    const Frame frame = frame_of(12'800'000);
    const std::int64_t edge = frame.edge_um * 1000;
    const auto point = [&] { return NanoPoint{between(random, -edge, edge), between(random, -edge, edge)}; };
    SCOPED_TRACE("case " + std::to_string(i));
    ASSERT_NO_FATAL_FAILURE(
        expect_as_clipped(frame, point(), point(), PatchSteps{9, static_cast<std::uint64_t>(i)}));
  }
}

TEST(RayWalkerTest, VisitsExactlyTheCellsThatClippingFindsOnLatticePoints) {
  // Ends on corners and edges of cells: through corners, along edges, from and to patch borders, zero length.
  Random random(2);
  const Frame frame = frame_of(2'048);
  constexpr std::int64_t kFinest = 2'048'000 / 32;
  for (int i = 0; i < 6000; ++i) {
    const PatchSteps steps{static_cast<int>(random() % 5), static_cast<std::uint64_t>(i), random() % 2 == 0};
    const std::int64_t lattice = kFinest << (random() % 5);
    const auto point = [&] {
      const auto jitter = [&] { return random() % 8 == 0 ? between(random, -1, 1) : 0; };
      return NanoPoint{between(random, -64, 64) * kFinest / lattice * lattice + jitter(),
                       between(random, -64, 64) * kFinest / lattice * lattice + jitter()};
    };
    SCOPED_TRACE("case " + std::to_string(i));
    ASSERT_NO_FATAL_FAILURE(expect_as_clipped(frame, point(), point(), steps));
  }
}

std::vector<CellIndex> cells_of(const std::vector<Visit>& visits) {
  std::vector<CellIndex> cells;
  for (const Visit& v : visits) cells.push_back(v.cell);
  return cells;
}

constexpr std::int64_t kMetre = 1'000'000'000;

TEST(RayWalkerTest, GoesAcrossCornersFromCellToCell) {
  const Frame frame = frame_of(8'000'000);  // 8 m, cells of 1 m
  const auto step = [](PatchIndex) { return 3; };
  using Cells = std::vector<CellIndex>;
  EXPECT_EQ(cells_of(walk(frame, {kMetre / 2, kMetre / 2}, {7 * kMetre / 2, 7 * kMetre / 2}, step)),
            (Cells{{0, 0}, {1, 1}, {2, 2}, {3, 3}}));
  EXPECT_EQ(cells_of(walk(frame, {kMetre / 2, 5 * kMetre / 2}, {5 * kMetre / 2, kMetre / 2}, step)),
            (Cells{{0, 2}, {1, 1}, {2, 0}}));
}

TEST(RayWalkerTest, RunsInTheUpperOrRightCellOfAnEdge) {
  const Frame frame = frame_of(8'000'000);
  const auto step = [](PatchIndex) { return 3; };
  using Cells = std::vector<CellIndex>;
  EXPECT_EQ(cells_of(walk(frame, {kMetre / 2, 2 * kMetre}, {3 * kMetre, 2 * kMetre}, step)),
            (Cells{{0, 2}, {1, 2}, {2, 2}, {3, 2}}));
  EXPECT_EQ(cells_of(walk(frame, {2 * kMetre, 3 * kMetre}, {2 * kMetre, kMetre}, step)),
            (Cells{{2, 3}, {2, 2}, {2, 1}}));
}

TEST(RayWalkerTest, VisitsOneCellWithoutLength) {
  const Frame frame = frame_of(8'000'000);
  const auto visits = walk(frame, {-1, -1}, {-1, -1}, [](PatchIndex) { return 3; });
  EXPECT_EQ(visits, (std::vector<Visit>{{{-1, -1}, 3, {7, 7}}}));
}

TEST(RayWalkerTest, EndsInTheCellsOfTheFrame) {
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    const Frame frame =
        frame_of(between(random, 1'000, 100'000'000), between(random, -1'000'000'000'000, 1'000'000'000'000),
                 between(random, -9'000'000'000'000, 9'000'000'000'000));
    const auto coordinate = [&](std::int64_t datum_um) {
      return static_cast<double>(datum_um) / 1e6 + std::uniform_real_distribution<double>(-1, 1)(random);
    };
    const Point from{coordinate(frame.datum_x_um), coordinate(frame.datum_y_um)};
    const Point to{coordinate(frame.datum_x_um), coordinate(frame.datum_y_um)};
    const int step = static_cast<int>(random() % 12);
    const Frame::Cell first = frame.cell_at(from, step), last = frame.cell_at(to, step);
    std::vector<Visit> visits;
    RayWalker(frame).walk(
        from, to, [&](PatchIndex) { return step; },
        [&](const RayRun& run, bool) {
          visits.push_back({run.patch, run.step, run.cells.front()}),
              visits.push_back({run.patch, run.step, run.cells.back()});
        });
    ASSERT_EQ(visits.front(), (Visit{first.patch, step, first.cell})) << i;
    ASSERT_EQ(visits.back(), (Visit{last.patch, step, last.cell})) << i;
  }
}

/// Long walks cannot be clipped cell by cell: the neighbourhood and the distance from the line are checked,
/// in exact arithmetic.
void expect_connected(const Frame& frame, NanoPoint from, NanoPoint to, int step) {
  const auto visits = walk(frame, from, to, [&](PatchIndex) { return step; });
  const Wide scale = Wide{1} << step, edge = Wide{frame.edge_um} * 1000;
  const Wide dx = Wide{to.x} - from.x, dy = Wide{to.y} - from.y;
  Wide last_i = 0, last_j = 0;
  for (std::size_t k = 0; k < visits.size(); ++k) {
    const Wide i = visits[k].patch.x * scale + visits[k].cell.a,
               j = visits[k].patch.y * scale + visits[k].cell.b;
    if (k > 0) {
      const Wide si = i - last_i, sj = j - last_j;
      ASSERT_TRUE(si == 0 || si == (dx > 0 ? 1 : -1));
      ASSERT_TRUE(sj == 0 || sj == (dy > 0 ? 1 : -1));
      ASSERT_TRUE(si != 0 || sj != 0);
    }
    int above = 0, below = 0;
    for (const Wide ci : {i, i + 1}) {
      for (const Wide cj : {j, j + 1}) {
        const Wide side = dx * (cj * edge - from.y * scale) - dy * (ci * edge - from.x * scale);
        above += side >= 0;
        below += side <= 0;
      }
    }
    ASSERT_TRUE(above > 0 && below > 0) << "cell " << k << " does not meet the line";
    last_i = i;
    last_j = j;
  }
}

TEST(RayWalkerTest, KeepsToTheLineFarFromTheDatum) {
  Random random(4);
  for (int i = 0; i < 60; ++i) {
    const Frame frame = frame_of(12'800'000, 570'000'000'000, 5'360'000'000'000);
    const std::int64_t far = 300'000 * kMetre;
    const NanoPoint from{between(random, -far, far), between(random, -far, far)};
    const NanoPoint to{from.x + between(random, -300 * kMetre, 300 * kMetre),
                       from.y + between(random, -300 * kMetre, 300 * kMetre)};
    // Whole micrometres: metres as doubles then stand for one nanometre each.
    const auto whole = [](NanoPoint p) { return NanoPoint{p.x / 1000 * 1000, p.y / 1000 * 1000}; };
    ASSERT_NO_FATAL_FAILURE(expect_connected(frame, whole(from), whole(to), static_cast<int>(random() % 10)))
        << i;
  }
}

TEST(RayWalkerTest, KeepsToTheLineOverHundredsOfKilometres) {
  Random random(5);
  for (int i = 0; i < 8; ++i) {
    const Frame frame = frame_of(10'000'000'000);  // 10 km
    const std::int64_t far = 499'000 * kMetre;
    const auto end = [&] { return between(random, -far, far) / 1000 * 1000; };
    ASSERT_NO_FATAL_FAILURE(expect_connected(frame, {end(), end()}, {end(), end()}, 11)) << i;
  }
}

TEST(RayWalkerTest, TellsWhichRunHoldsTheEnd) {
  const Frame frame = frame_of(1'000'000);
  std::vector<std::pair<PatchIndex, bool>> runs;
  const auto visit = [&](const RayRun& run, bool last) { runs.emplace_back(run.patch, last); };
  RayWalker walker(frame);
  walker.walk(
      {0.5, 0.5}, {2.5, 0.5}, [](PatchIndex p) { return p.x == 1 ? std::nullopt : std::optional(4); }, visit);
  EXPECT_EQ(runs, (std::vector<std::pair<PatchIndex, bool>>{{{0, 0}, false}, {{2, 0}, true}}));
  runs.clear();
  walker.walk(
      {0.5, 0.5}, {2.5, 0.5}, [](PatchIndex p) { return p.x == 2 ? std::nullopt : std::optional(4); }, visit);
  EXPECT_EQ(runs, (std::vector<std::pair<PatchIndex, bool>>{{{0, 0}, false}, {{1, 0}, false}}));
}

ErrorCode code_of(const Frame& frame, Point from, Point to, int step = 3) {
  try {
    RayWalker(frame).walk(
        from, to, [&](PatchIndex) { return step; }, [](const RayRun&, bool) {});
  } catch (const Error& error) {
    return error.code();
  }
  ADD_FAILURE() << "no error";
  return ErrorCode::kCancelled;
}

TEST(RayWalkerTest, RefusesWhatItCannotWalk) {
  const Frame frame = frame_of(1'000);
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(code_of(frame, {nan, 0}, {0, 0}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code_of(frame, {0, 0}, {0, inf}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code_of(frame, {0, 0}, {0, 1e300}), ErrorCode::kLimit);
  EXPECT_EQ(code_of(frame, {0, 0}, {3e6, 0}), ErrorCode::kLimit);  // beyond patch 2^31
  EXPECT_EQ(code_of(frame, {0, 0}, {1'000'001, 0}), ErrorCode::kLimit);
  EXPECT_EQ(code_of(frame, {0, 0}, {0.0001, 0}, 12), ErrorCode::kLimit);
  EXPECT_EQ(code_of(frame, {0, 0}, {0.0001, 0}, -1), ErrorCode::kLimit);
}

}  // namespace
}  // namespace apgm

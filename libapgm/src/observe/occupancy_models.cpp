#include "observe/occupancy_models.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "apgm/core/portable_math.hpp"
#include "fuse/evidence.hpp"
#include "fuse/simd.hpp"

namespace apgm::observe {
namespace {

/// m(F) of the crossed cells of a row whose first centre lies (x, y) from the sensor, float32 metres.
APGM_CLONES
void free_row(float* mark, int cells, float x, float y, float cell, float free_max, float slope) {
  const float yy = y * y;
  for (int a = 0; a < cells; ++a) {
    const float dx = x + static_cast<float>(a) * cell;
    const float mass = free_max - slope * std::sqrt(dx * dx + yy);
    const float positive = mass > 0.0f ? mass : 0.0f;
    mark[a] = mark[a] > 0.0f ? positive : 0.0f;
  }
}

/// Evidence that leaves m(Omega) = 2^-24, so that no sum of masses exceeds kMostMass.
constexpr double kMostLambda = 24 * std::numbers::ln2;

/// Powers 0, 1, ... of p, until they vanish beside 1 or the table is long enough.
std::vector<double> powers_of(double p) {
  constexpr std::size_t kMost = 4096;
  std::vector<double> powers{1.0};
  while (powers.back() > 1e-18 && powers.size() < kMost) powers.push_back(powers.back() * p);
  return powers;
}

/// p^n; beyond the table by its longest power, so that n of any size ends.
double power(const std::vector<double>& powers, float n) {
  auto left = static_cast<std::size_t>(n);
  double result = 1;
  for (const std::size_t most = powers.size() - 1; left > most && result > 1e-18; left -= most) {
    result *= powers.back();
  }
  return result > 1e-18 ? result * powers[std::min(left, powers.size() - 1)] : 0.0;
}

}  // namespace

Point within_patch(const GridPoint& p, PatchIndex patch, const Frame& frame) {
  const auto along = [&](std::int64_t nm, std::int32_t index) {
    return static_cast<double>(static_cast<__int128>(nm) - static_cast<__int128>(index) * edge_nm(frame)) *
           1e-9;
  };
  return {along(p.x, patch.x), along(p.y, patch.y)};
}

double nuss_relevance(const NussModel& model, Point at, CellIndex cell, double cell_m) {
  const double sigma_m = std::max(model.sigma_m, cell_m * (std::numbers::sqrt2 / 2));
  const double dx = at.x_m - (cell.a + 0.5) * cell_m, dy = at.y_m - (cell.b + 0.5) * cell_m;
  return model.occ_max * portable::exp(-(dx * dx + dy * dy) / (2 * sigma_m * sigma_m));
}

void finish_nuss(const NussModel& model, Point origin, double cell_m, ObservedLayer& layer) {
  const int side = layer.cells.side();
  const auto x = static_cast<float>(0.5 * cell_m - origin.x_m);
  const auto slope = static_cast<float>(model.free_max / model.free_range_m);
  const float free_max = std::min(static_cast<float>(model.free_max), kMostMass);
  for (int b = layer.rows.begin; b < layer.rows.end; ++b) {
    const auto y = static_cast<float>((b + 0.5) * cell_m - origin.y_m);
    free_row(layer.cells.plane(1).data() + static_cast<std::size_t>(b) * side, side, x, y,
             static_cast<float>(cell_m), free_max, slope);
  }
}

RichterFinish::RichterFinish(const RichterModel& model)
    : fn_(powers_of(model.p_fn)), fp_(powers_of(model.p_fp)) {}

RichterFinish::Masses RichterFinish::masses(float returns, float passages) const {
  const double fn = power(fn_, passages), fp = power(fp_, returns);
  const float occupied = std::min(static_cast<float>(fn * (1 - fp)), kMostMass);
  const float free = std::min(static_cast<float>(fp * (1 - fn)), kMostMass);
  return {occupied, std::min(free, 1.0f - occupied)};
}

void RichterFinish::operator()(ObservedLayer& layer) const {
  const auto side = static_cast<std::size_t>(layer.cells.side());
  const auto occupied = layer.cells.plane(0), free = layer.cells.plane(1);
  for (std::size_t i = static_cast<std::size_t>(layer.rows.begin) * side;
       i < static_cast<std::size_t>(layer.rows.end) * side; ++i) {
    if (occupied[i] == 0 && free[i] == 0) continue;
    const Masses m = masses(occupied[i], free[i]);
    occupied[i] = m.occupied;
    free[i] = m.free;
  }
}

void finish_camera(const CameraModel& model, ObservedLayer& layer) {
  const double lambda_of_pixel = -portable::log1p(-model.rho);
  const auto classes = static_cast<std::size_t>(layer.cells.channels() - 1);
  const auto side = static_cast<std::size_t>(layer.cells.side());
  std::array<float*, 16> plane{};
  for (int c = 0; c < layer.cells.channels(); ++c) {
    plane[static_cast<std::size_t>(c)] = layer.cells.plane(c).data();
  }
  std::array<double, 16> lambda{};
  std::array<float, 16> masses{};
  for (std::size_t i = static_cast<std::size_t>(layer.rows.begin) * side;
       i < static_cast<std::size_t>(layer.rows.end) * side; ++i) {
    double total = 0;
    for (std::size_t k = 0; k < classes; ++k) total += lambda[k] = lambda_of_pixel * plane[k][i];
    if (total == 0) continue;
    if (total > kMostLambda) {
      for (std::size_t k = 0; k < classes; ++k) lambda[k] *= kMostLambda / total;
    }
    fuse::masses_from_evidence(lambda.data(), classes, masses.data(), plane[classes][i]);
    for (std::size_t k = 0; k < classes; ++k) plane[k][i] = std::min(masses[k], kMostMass);
  }
}

}  // namespace apgm::observe

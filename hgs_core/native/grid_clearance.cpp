// Exact distances from points of the plane to the boxes of blocked cells.
//
// The distance of a point p to the box of cell c is |max(|p - centre(c)| - 1/2, 0)|, taken per axis. Everything
// outside the grid is blocked, so the distance to the grid's border bounds it, too.
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "grid_kernels.hpp"
#include "whole_number.hpp"

namespace hgs {
namespace {

inline double border_distance(double x, double y, int nx, int ny) {
  return std::max(0.0, std::min(std::min(x, nx - x), std::min(y, ny - y)));
}

inline double box_distance(double x, double y, int i, int j) {
  const double dx = std::max(std::abs(x - (i + 0.5)) - 0.5, 0.0);
  const double dy = std::max(std::abs(y - (j + 0.5)) - 0.5, 0.0);
  return std::sqrt(dx * dx + dy * dy);
}

// The least box distance at (x, y), if it is below `least`; otherwise `least`.
double lower_by_boxes(const uint8_t* blocked, int nx, int ny, double x, double y, double least) {
  least = std::min(least, border_distance(x, y, nx, ny));
  const int i0 = floor_within(x - least, 0, nx);
  const int i1 = floor_within(x + least, -1, nx - 1);
  const int j0 = floor_within(y - least, 0, ny);
  const int j1 = floor_within(y + least, -1, ny - 1);
  for (int i = i0; i <= i1; ++i)
    for (int j = j0; j <= j1; ++j)
      if (blocked[static_cast<size_t>(i) * ny + j]) least = std::min(least, box_distance(x, y, i, j));
  return least;
}

}  // namespace

void grid_box_clearance(const uint8_t* blocked, int nx, int ny, float cap, float* clearance) {
  const auto at = [&](int i, int j) { return blocked[static_cast<size_t>(i) * ny + j] != 0; };
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j)
      clearance[static_cast<size_t>(i) * ny + j] =
          at(i, j) ? 0.0f : std::min(cap, static_cast<float>(border_distance(i + 0.5, j + 0.5, nx, ny)));
  const int reach = floor_within(std::ceil(cap + 0.5f), 0, std::max(nx, ny));
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j) {
      if (!at(i, j)) continue;
      // Only a blocked cell with an open face-neighbour can be the nearest one of an open cell.
      const bool exposed = (i > 0 && !at(i - 1, j)) || (i + 1 < nx && !at(i + 1, j)) || (j > 0 && !at(i, j - 1)) ||
                           (j + 1 < ny && !at(i, j + 1));
      if (!exposed) continue;
      for (int u = std::max(0, i - reach); u <= std::min(nx - 1, i + reach); ++u)
        for (int v = std::max(0, j - reach); v <= std::min(ny - 1, j + reach); ++v) {
          float& value = clearance[static_cast<size_t>(u) * ny + v];
          if (value > 0.0f) value = std::min(value, static_cast<float>(box_distance(u + 0.5, v + 0.5, i, j)));
        }
    }
}

namespace {

struct SegmentSum {
  double least_clearance, cost;
};

// Samples a segment; gives up once the clearance falls below `least_allowed` or the cost exceeds `most_allowed` (what
// is returned then lies beyond that bound, too).
SegmentSum along_segment(const FloorGrid& floor, const double* seg, double step, double cap, double least_allowed,
                         double most_allowed) {
  const int nx = floor.nx, ny = floor.ny;
  const double dx = seg[2] - seg[0];
  const double dy = seg[3] - seg[1];
  const double length = std::sqrt(dx * dx + dy * dy);
  const int n = parts_of(length, step, 1);
  double least = cap;
  double total = 0.0;
  for (int k = 0; k <= n; ++k) {
    const double t = static_cast<double>(k) / n;
    const double x = seg[0] + t * dx;
    const double y = seg[1] + t * dy;
    if (!(x >= 0 && y >= 0 && x < nx && y < ny)) {
      least = 0.0;
    } else {
      const int i = static_cast<int>(x);
      const int j = static_cast<int>(y);
      const size_t cell = static_cast<size_t>(i) * ny + j;
      total += (k == 0 || k == n ? 0.5 : 1.0) * floor.soft_cost[cell];
      // Clearance is 1-Lipschitz: the field at the cell's centre bounds it from below, so most samples end here.
      const double bound = floor.clearance[cell] - std::hypot(x - (i + 0.5), y - (j + 0.5));
      if (bound < least) least = lower_by_boxes(floor.blocked, nx, ny, x, y, least);
    }
    if (least < least_allowed || total * length / n > most_allowed) break;
  }
  return {least, total * length / n};
}

}  // namespace

void grid_segments(const FloorGrid& floor, const double* segments, int n_segments, double step, double cap,
                   double* least_clearance, double* cost) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (int s = 0; s < n_segments; ++s) {
    const SegmentSum sum = along_segment(floor, segments + static_cast<size_t>(s) * 4, step, cap, -kInfinity, kInfinity);
    least_clearance[s] = sum.least_clearance;
    cost[s] = sum.cost;
  }
}

int grid_straighten(const FloorGrid& floor, const double* points, int n_points, double step, double cap,
                    double wanted_clearance, double cost_factor, int32_t* kept) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  constexpr double kTolerance = 1e-6;
  std::vector<double> clear(n_points), total(n_points, 0.0), run_clear(n_points);
  const auto segment = [&](int a, int b, double least, double most) {
    const double seg[4] = {points[2 * a], points[2 * a + 1], points[2 * b], points[2 * b + 1]};
    return along_segment(floor, seg, step, cap, least, most);
  };
  for (int k = 0; k + 1 < n_points; ++k) {
    const SegmentSum sum = segment(k, k + 1, -kInfinity, kInfinity);
    clear[k] = sum.least_clearance;
    total[k + 1] = total[k] + sum.cost;
  }
  int n_kept = 0;
  for (int i = 0; i < n_points;) {
    kept[n_kept++] = i;
    if (i == n_points - 1) break;
    run_clear[i] = kInfinity;
    for (int j = i + 1; j < n_points; ++j) run_clear[j] = std::min(run_clear[j - 1], clear[j - 1]);
    int next = i + 1;
    for (int j = n_points - 1; j > i + 1; --j) {
      const double least = std::min(wanted_clearance, run_clear[j]) - kTolerance;
      const double most = cost_factor * (total[j] - total[i]);
      const SegmentSum line = segment(i, j, least, most);
      if (line.least_clearance >= least && line.cost <= most) {
        next = j;
        break;
      }
    }
    i = next;
  }
  return n_kept;
}

}  // namespace hgs

// Looks in vain.
//
// An unobserved voxel was looked at in vain by a frame when
//   - one of its face-neighbours is free (so that it would count as missing),
//   - its centre projects into the image, `border_px` away from the edge, not farther than `range`,
//   - every voxel between the camera and it is free, so that nothing known stands before it,
//   - and yet the depth measured at that pixel ends in another voxel before it.
// The last condition tells a look in vain from a look that never happened: no return (0) says nothing, and a
// depth beyond the voxel means that the sampled rays went past it (a gap between strided pixels).
#include <algorithm>
#include <cmath>

#include "voxel_kernels.hpp"

namespace hgs {
namespace {

bool has_free_neighbour(const Grid& grid, const std::uint8_t* states, const Cell& c) {
  for (int a = 0; a < 3; ++a) {
    for (int side = -1; side <= 1; side += 2) {
      Cell n = c;
      n[a] += side;
      if (grid.contains(n) && states[grid.offset(n)] == kFree) return true;
    }
  }
  return false;
}

}  // namespace

std::int64_t count_attempts(const Grid& grid, const std::uint8_t* states, std::uint8_t* attempts,
                            const GridCamera& camera, const float* depth_m, double range_m, double cell_m,
                            double border_px, const ChangedChunks& changed) {
  const double range = range_m / cell_m;
  // The box around the view pyramid: its apex and the four corners of its base.
  const auto& r = camera.rotation;
  Point low = camera.position, high = camera.position;
  for (const double u : {0.0, static_cast<double>(camera.width)}) {
    for (const double v : {0.0, static_cast<double>(camera.height)}) {
      const Point ray{(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0};
      for (int a = 0; a < 3; ++a) {
        const double x =
            camera.position[a] + range * (r[3 * a] * ray[0] + r[3 * a + 1] * ray[1] + r[3 * a + 2] * ray[2]);
        low[a] = std::min(low[a], x);
        high[a] = std::max(high[a], x);
      }
    }
  }
  Cell first = cell_of(low), last = cell_of(high);
  for (int a = 0; a < 3; ++a) {
    first[a] = std::max<std::int64_t>(first[a], 0);
    last[a] = std::min(last[a], grid.shape[a] - 1);
  }

  std::int64_t n_attempts = 0;
#pragma omp parallel for schedule(dynamic, 2) reduction(+ : n_attempts)
  for (std::int64_t i = first[0]; i <= last[0]; ++i) {
    for (std::int64_t j = first[1]; j <= last[1]; ++j) {
      for (std::int64_t k = first[2]; k <= last[2]; ++k) {
        const Cell cell{i, j, k};
        const std::int64_t voxel = grid.offset(cell);
        if (states[voxel] != kUnobserved || !has_free_neighbour(grid, states, cell)) continue;

        const Point centre{i + 0.5, j + 0.5, k + 0.5};
        Point p;  // in the camera
        for (int a = 0; a < 3; ++a) {
          p[a] = r[a] * (centre[0] - camera.position[0]) + r[3 + a] * (centre[1] - camera.position[1]) +
                 r[6 + a] * (centre[2] - camera.position[2]);
        }
        if (!(p[2] > 0.5 && p[2] <= range)) continue;
        const double u = camera.fx * p[0] / p[2] + camera.cx, v = camera.fy * p[1] / p[2] + camera.cy;
        if (!(u >= border_px && v >= border_px && u < camera.width - border_px && v < camera.height - border_px)) continue;
        const double measured =
            depth_m[static_cast<std::int64_t>(v) * camera.width + static_cast<std::int64_t>(u)] / cell_m;
        if (!(measured > 0.0 && measured < p[2])) continue;
        Point end;
        for (int a = 0; a < 3; ++a) end[a] = camera.position[a] + (centre[a] - camera.position[a]) * (measured / p[2]);
        if (cell_of(end) == cell) continue;

        double t_first, t_last;
        if (!clip_to_grid(grid, camera.position, centre, t_first, t_last)) continue;
        const bool clear =
            walk(grid, camera.position, centre, t_first, t_last, [&](const Cell& c, double, double) {
              return c == cell || states[grid.offset(c)] == kFree;
            });
        if (!clear) continue;
        if (attempts[voxel] < 255) ++attempts[voxel];
        changed.mark(i, j);
        ++n_attempts;
      }
    }
  }
  return n_attempts;
}

}  // namespace hgs

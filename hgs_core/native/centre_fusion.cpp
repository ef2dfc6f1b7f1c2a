#include "centre_fusion.hpp"

#include <omp.h>

#include <algorithm>
#include <cmath>

namespace hgs {

namespace {

constexpr float kNear = 0.1f;

// Inverse depth interpolated between the four pixels around (u, v); 0 when they are not one surface.
float interpolated_depth(const FusionView& view, float u, float v, float edge_m) {
  const float x = u - 0.5f, y = v - 0.5f;
  if (!(x >= 0.0f && y >= 0.0f && x < float(view.width) && y < float(view.height))) return 0.0f;
  const int x0 = int(x), y0 = int(y);
  if (x0 + 1 >= view.width || y0 + 1 >= view.height) return 0.0f;
  const float* p = view.depth + long(y0) * view.width + x0;
  const float z[4] = {p[0], p[1], p[view.width], p[view.width + 1]};
  const float low = std::min(std::min(z[0], z[1]), std::min(z[2], z[3]));
  const float high = std::max(std::max(z[0], z[1]), std::max(z[2], z[3]));
  if (!(low > 0.0f) || !(high - low < edge_m)) return 0.0f;
  const float ax = x - float(x0), ay = y - float(y0);
  const float inverse = (1 - ay) * ((1 - ax) / z[0] + ax / z[1]) + ay * ((1 - ax) / z[2] + ax / z[3]);
  return 1.0f / inverse;
}

// Whether a Gaussian at (u, v, z) that nothing hides is wider than this view would make it. At the border of a surface
// its pixel may show what lies behind: then the limit there is brought to its own distance. Wide ones at borders stick
// out of the surface, and averaging never touches them.
bool is_coarse(const FusionView& view, float u, float v, float z, float gate, float radius) {
  if (!(u >= 0.0f) || !(v >= 0.0f) || !(u < float(view.width)) || !(v < float(view.height))) return false;
  const long at = long(v) * view.width + long(u);
  const float seen = view.depth[at];
  if (!(seen > 0.0f) || !std::isfinite(seen) || seen < z - gate) return false;
  return radius > view.largest_radius[at] * std::min(1.0f, z / seen);
}

// Whether a box may touch the view up to a depth: false only when all corners lie behind, beyond that depth or beyond
// one image border.
bool block_in_view(const float* bounds, const FusionView& view, float farthest) {
  int behind = 0, beyond = 0, left = 0, right = 0, above = 0, below = 0;
  const float* r = view.rotation;
  const float left_slope = -view.cx / view.fx, right_slope = (float(view.width) - view.cx) / view.fx;
  const float top_slope = -view.cy / view.fy, bottom_slope = (float(view.height) - view.cy) / view.fy;
  for (int corner = 0; corner < 8; ++corner) {
    float d[3];
    for (int axis = 0; axis < 3; ++axis) {
      d[axis] = bounds[axis + ((corner >> axis) & 1) * 3] - view.translation[axis];
    }
    const float x = r[0] * d[0] + r[3] * d[1] + r[6] * d[2];
    const float y = r[1] * d[0] + r[4] * d[1] + r[7] * d[2];
    const float z = r[2] * d[0] + r[5] * d[1] + r[8] * d[2];
    behind += z < kNear;
    beyond += z > farthest;
    left += x < left_slope * z;
    right += x > right_slope * z;
    above += y < top_slope * z;
    below += y > bottom_slope * z;
  }
  return behind < 8 && beyond < 8 && left < 8 && right < 8 && above < 8 && below < 8;
}

}  // namespace

void fuse_centres(float* parameters, std::uint16_t* counts, long n, const float* bounds, int block,
                  const FusionView& view, float gate_m, float gate_slope, int max_count,
                  std::vector<std::int32_t>& coarse_rows) {
  const long n_blocks = (n + block - 1) / block;
  float deepest = 0.0f;
  for (long i = 0; i < long(view.width) * view.height; ++i) {
    if (std::isfinite(view.depth[i])) deepest = std::max(deepest, view.depth[i]);
  }
  // Where z - gate_m - gate_slope z is the deepest measurement, and a little more.
  const float farthest = gate_slope < 0.5f ? 1.001f * (deepest + gate_m) / (1.0f - gate_slope) : INFINITY;
  const float* r = view.rotation;
  const float* t = view.translation;
  std::vector<std::vector<std::int32_t>> coarse(static_cast<std::size_t>(omp_get_max_threads()));
#pragma omp parallel for schedule(static)
  for (long b = 0; b < n_blocks; ++b) {
    if (!block_in_view(bounds + 6 * b, view, farthest)) continue;
    auto& mine = coarse[static_cast<std::size_t>(omp_get_thread_num())];
    for (long i = b * block; i < std::min(n, (b + 1) * block); ++i) {
      float* centre = parameters + 8 * i;
      const float d[3] = {centre[0] - t[0], centre[1] - t[1], centre[2] - t[2]};
      const float z = r[2] * d[0] + r[5] * d[1] + r[8] * d[2];
      if (!(z >= kNear)) continue;
      const float u = view.fx * (r[0] * d[0] + r[3] * d[1] + r[6] * d[2]) / z + view.cx;
      const float v = view.fy * (r[1] * d[0] + r[4] * d[1] + r[7] * d[2]) / z + view.cy;
      const float gate = gate_m + gate_slope * z;
      if (is_coarse(view, u, v, z, gate, std::exp(centre[6]))) mine.push_back(std::int32_t(i));
      const float seen = interpolated_depth(view, u, v, 4.0f * gate);
      if (seen == 0.0f || std::abs(seen - z) > gate) continue;
      const int count = std::min<int>(counts[i], max_count);
      const float factor = 1.0f + (seen / z - 1.0f) / float(count + 1);
      for (int axis = 0; axis < 3; ++axis) centre[axis] = t[axis] + d[axis] * factor;
      counts[i] = std::uint16_t(std::min<int>(counts[i] + 1, 65535));
    }
  }
  // A static schedule gives each thread one ascending run of blocks: joining the runs keeps the order.
  for (const auto& rows : coarse) coarse_rows.insert(coarse_rows.end(), rows.begin(), rows.end());
}

}  // namespace hgs

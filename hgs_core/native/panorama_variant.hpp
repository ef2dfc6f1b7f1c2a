// Rays marched through voxels, one in each lane: exact traversal in lockstep (Amanatides & Woo, 1987), where each
// crossing is computed afresh from the number of the plane it crosses, so that rounding does not add up.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "panorama.hpp"
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

// One axis of the rays' walk.
struct AxisWalk {
  VFloat from, per_cell;  // start, and ray parameter per cell
  VInt forward;           // which rays go up
  VInt cell;
  VFloat t_next;

  HGS_INLINE void plan() {
    t_next = (to_float(cell - forward) - from) * per_cell;  // a true comparison is -1
  }
  HGS_INLINE void step(VInt lanes) {
    cell += lanes & (forward ? VInt{} + 1 : VInt{} - 1);
    plan();
  }
};

// Narrows [t_first, t_last] to the part inside the grid.
HGS_INLINE AxisWalk enter_axis(float from, VFloat d, float cells, VFloat& t_first, VFloat& t_last) {
  const VFloat tiny = splat_all(1e-6f);
  const VFloat safe = (d < tiny) & (d > -tiny) ? tiny : d;
  AxisWalk axis;
  axis.from = splat_all(from);
  axis.per_cell = 1.0f / safe;
  axis.forward = safe > 0.0f;
  const VFloat at_low = -from * axis.per_cell, at_high = (cells - from) * axis.per_cell;
  t_first = vmax(t_first, vmin(at_low, at_high));
  t_last = vmin(t_last, vmax(at_low, at_high));
  return axis;
}

HGS_INLINE void start_axis(AxisWalk& axis, VFloat d, VFloat t_first, int cells) {
  const VInt cell = to_cell(axis.from + t_first * d), last = VInt{} + (cells - 1);
  axis.cell = cell < 0 ? VInt{} : (cell > last ? last : cell);
  axis.plan();
}

// Integral of min(1, (t / saturation)^2) over [t_0, t_1].
HGS_INLINE VFloat quality_length(VFloat t_0, VFloat t_1, float saturation) {
  if (saturation <= 0.0f) return t_1 - t_0;
  const VFloat edge = splat_all(saturation);
  const VFloat near_0 = vmin(t_0, edge), near_1 = vmin(t_1, edge);
  const VFloat near = (near_1 * near_1 * near_1 - near_0 * near_0 * near_0) * (1.0f / (3.0f * saturation * saturation));
  return near + (vmax(t_1, edge) - vmax(t_0, edge));
}

static void march_rays(const PanoramaCells& grid, const PanoramaRays& rays, const Panorama& panorama,
                       const PanoramaSums& sums) {
  constexpr float SURFACE = 0.6931f;  // stops half of the light over one edge length
  const float opaque_below = static_cast<float>(panorama.opaque_below);
  const float saturation = static_cast<float>(panorama.saturation / panorama.range);
  const float face_gap = static_cast<float>(panorama.face_gap / panorama.range);
  const float* channels = &grid.cells->optical_depth;
  const VFloat infinite = splat_all(__builtin_inff());
  for (int first = 0; first < rays.n; first += LANES) {
    const int n = rays.n - first < LANES ? rays.n - first : LANES;
    alignas(64) float padded[4][LANES] = {};
    for (int lane = 0; lane < n; ++lane) {
      padded[0][lane] = rays.dx[first + lane];
      padded[1][lane] = rays.dy[first + lane];
      padded[2][lane] = rays.dz[first + lane];
      padded[3][lane] = rays.length[first + lane];
    }
    const VFloat dx = load(padded[0]), dy = load(padded[1]), dz = load(padded[2]), length = load(padded[3]);
    VFloat t_enter{}, t_last = length > 0.0f ? splat_all(1.0f) : splat_all(-1.0f);
    AxisWalk x = enter_axis(rays.from[0], dx, static_cast<float>(grid.shape[0]), t_enter, t_last);
    AxisWalk y = enter_axis(rays.from[1], dy, static_cast<float>(grid.shape[1]), t_enter, t_last);
    AxisWalk z = enter_axis(rays.from[2], dz, static_cast<float>(grid.shape[2]), t_enter, t_last);
    start_axis(x, dx, t_enter, grid.shape[0]);
    start_axis(y, dy, t_enter, grid.shape[1]);
    start_axis(z, dz, t_enter, grid.shape[2]);
    VInt active = t_enter < t_last;
    VFloat now = splat_all(1.0f), before_face = now, face_left = -infinite;
    VFloat volume{}, voxels{}, gained{};
    while (any(active)) {
      const VFloat t_leave = vmax(vmin(vmin(vmin(x.t_next, y.t_next), z.t_next), t_last), t_enter);
      const VInt cell = ((x.cell * grid.shape[1] + y.cell) * grid.shape[2] + z.cell) * 3;
      before_face = t_enter - face_left <= face_gap ? before_face : now;
      active &= before_face >= opaque_below;
      const VFloat optical_depth = gather(channels, cell, active);
      const VFloat unseen = gather(channels + 1, cell, active);
      const VFloat quality = gather(channels + 2, cell, active);
      const VInt adds = (unseen > 0.0f) & (now >= opaque_below);
      if (any(adds)) {
        const VFloat added = adds ? now : VFloat{};
        volume += added * (t_leave * t_leave * t_leave - t_enter * t_enter * t_enter);
        voxels += added;
      }
      const VInt dims = optical_depth > 0.0f;
      if (any(dims | (quality > 0.0f))) {
        gained += before_face * quality * quality_length(t_enter, t_leave, saturation);
        const VInt opaque = optical_depth == infinite;
        const VFloat tau = opaque ? VFloat{} : optical_depth;
        now = opaque ? VFloat{} : now * vexp(-tau * (t_leave - t_enter) * length);
        face_left = optical_depth >= SURFACE ? t_leave : face_left;
      }
      const VInt by_x = (x.t_next <= y.t_next) & (x.t_next <= z.t_next);
      const VInt by_y = ~by_x & (y.t_next <= z.t_next);
      x.step(by_x);
      y.step(by_y);
      z.step(~(by_x | by_y));
      t_enter = t_leave;
      active &= (t_leave < t_last) & (x.cell >= 0) & (x.cell < grid.shape[0]) & (y.cell >= 0) &
                (y.cell < grid.shape[1]) & (z.cell >= 0) & (z.cell < grid.shape[2]);
    }
    for (int lane = 0; lane < n; ++lane) {
      sums.volume[first + lane] = volume[lane];
      sums.voxels[first + lane] = voxels[lane];
      sums.quality[first + lane] = gained[lane];
    }
  }
}

}  // namespace hgs::HGS_VARIANT

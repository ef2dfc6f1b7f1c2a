// Rays marched through voxels, one in each lane.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "gain_rows.hpp"
#include "panorama.hpp"
#include "ray_walk_variant.hpp"
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

// Flags the chunks that rays have just come into.
HGS_INLINE void note_chunks(const RayWalk& walk, std::int32_t chunks_y, VInt& chunk, std::uint8_t* entered) {
  const VInt now = (walk.x.cell >> CHUNK_SHIFT) * chunks_y + (walk.y.cell >> CHUNK_SHIFT);
  const VInt changed = (now != chunk) & walk.active;
  chunk = now;
  if (!any(changed)) return;
  alignas(64) std::int32_t index[LANES];
  store(index, now);
  for (std::uint32_t lanes = lane_bits(changed); lanes != 0; lanes &= lanes - 1) {
    entered[index[__builtin_ctz(lanes)]] = 1;
  }
}

static void march_rays(const PanoramaCells& grid, const PanoramaRays& rays, const Panorama& panorama,
                       const PanoramaSums& sums) {
  const float opaque_below = static_cast<float>(panorama.opaque_below);
  const float unseen_depth = static_cast<float>(panorama.unseen_depth);
  const float* channels = &grid.cells->optical_depth;
  const VFloat infinite = splat_all(__builtin_inff()), third_of_range = splat_all(static_cast<float>(panorama.range / 3.0));
  for (int first = 0; first < rays.n; first += LANES) {
    const int n = rays.n - first < LANES ? rays.n - first : LANES;
    alignas(64) float padded[4][LANES] = {};
    for (int lane = 0; lane < n; ++lane) {
      padded[0][lane] = rays.dx[first + lane];
      padded[1][lane] = rays.dy[first + lane];
      padded[2][lane] = rays.dz[first + lane];
      padded[3][lane] = rays.length[first + lane];
    }
    const VFloat length = load(padded[3]);
    RayWalk walk(rays.from, load(padded[0]), load(padded[1]), load(padded[2]), grid.shape, VFloat{},
                 length > 0.0f ? splat_all(1.0f) : splat_all(-1.0f));
    VFloat left = splat_all(1.0f), volume{}, voxels{}, surface{};
    VInt chunk = VInt{} - 1, first_unseen = VInt{} - 1;
    note_chunks(walk, grid.chunks_y, chunk, sums.entered);
    while (any(walk.active)) {
      const VFloat t_enter = walk.t_enter, t_leave = walk.t_leave();
      const VInt cell = walk.cell(grid.shape) * 2;
      const VFloat optical_depth = gather(channels, cell, walk.active);
      const VFloat unseen = gather(channels + 1, cell, walk.active);
      const VInt adds = unseen > 0.0f;
      if (any(adds)) {
        const VFloat added = adds ? left : VFloat{};
        first_unseen = adds & (first_unseen < 0) ? cell >> 1 : first_unseen;
        volume += added * (t_leave * t_leave * t_leave - t_enter * t_enter * t_enter);
        voxels += added;
        if (unseen_depth > 0.0f) {
          const VFloat per_cell = unseen_depth * unseen;
          surface += added * per_cell * (t_leave * t_leave * t_leave - t_enter * t_enter * t_enter) * third_of_range;
          left = adds ? left * vexp(-per_cell * (t_leave - t_enter) * length) : left;
        }
      }
      if (any(optical_depth > 0.0f)) {
        const VInt opaque = optical_depth == infinite;
        const VFloat tau = opaque ? VFloat{} : optical_depth;
        left = opaque ? VFloat{} : left * vexp(-tau * (t_leave - t_enter) * length);
      }
      walk.advance(t_leave, grid.shape);
      // Before a ray may end: what it has ended on may lie just behind the border of a chunk.
      note_chunks(walk, grid.chunks_y, chunk, sums.entered);
      walk.active &= left >= opaque_below;
    }
    for (int lane = 0; lane < n; ++lane) {
      sums.volume[first + lane] = volume[lane];
      sums.voxels[first + lane] = voxels[lane];
      sums.surface[first + lane] = surface[lane];
      sums.first_unseen[first + lane] = first_unseen[lane];
    }
  }
}

}  // namespace hgs::HGS_VARIANT

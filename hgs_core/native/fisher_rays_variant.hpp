// Which Gaussians touch which sampled ray, sixteen Gaussians at a time.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "fisher_rays.hpp"
#include "rasterise.hpp"
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

inline constexpr float NEAREST_M = 0.1f;

// atan2 to 2e-6 rad (a minimax polynomial on the first octant).
HGS_INLINE VFloat vatan2(VFloat y, VFloat x) {
  const VFloat ax = x < 0.0f ? -x : x, ay = y < 0.0f ? -y : y;
  const VInt steep = ay > ax;
  const VFloat low = steep ? ax : ay, high = steep ? ay : ax;
  const VFloat t = low / vmax(high, splat_all(1e-20f)), t2 = t * t;
  VFloat p = t2 * -0.0117212f + 0.05265332f;
  p = p * t2 - 0.11643287f;
  p = p * t2 + 0.19354346f;
  p = p * t2 - 0.33262347f;
  p = p * t2 + 0.99997726f;
  VFloat angle = p * t;
  angle = steep ? 1.57079633f - angle : angle;
  angle = x < 0.0f ? 3.14159265f - angle : angle;
  return y < 0.0f ? -angle : angle;
}

static void prepare_ray_block(const float* parameters, std::int32_t n, RayBlock& block) {
  alignas(64) float logits[BLOCK + 16];
  const int padded = (n + LANES - 1) / LANES * LANES;
  for (int i = 0; i < n; ++i) {
    const float* p = parameters + N_PARAMETERS * i;
    block.x[i] = p[0];
    block.y[i] = p[1];
    block.z[i] = p[2];
    block.radius[i] = p[6];
    logits[i] = p[7];
  }
  for (int i = n; i < padded; ++i) block.x[i] = block.y[i] = block.z[i] = block.radius[i] = logits[i] = -100.0f;
  for (int i = 0; i < padded; i += LANES) {
    store(block.radius + i, vexp(load(block.radius + i)));
    const VFloat opacity = 1.0f / (1.0f + vexp(-load(logits + i)));
    store(block.decay + i, 1.38629436f * (vlog2_rough(vmax(opacity * 255.0f, splat_all(0.5f))) + 1e-3f));
  }
  block.n = n;
}

HGS_INLINE std::uint64_t sort_key(float depth, std::uint32_t map_row) {
  std::uint32_t bits;
  __builtin_memcpy(&bits, &depth, sizeof bits);
  return std::uint64_t{bits} << 32 | map_row;
}

struct LargeSplat {
  float row, column;  // where it lies among the rays
  float reach;        // as a tangent
  float rho;          // [m]
  std::uint32_t map_row;
};

// A splat that may touch several rays.
static std::int64_t hit_rays_around(const LargeSplat& splat, const RayGrid& grid, RayHit* hits, std::int64_t n_hits,
                                    std::int64_t room) {
  const float up = splat.reach / grid.d_tan, across = splat.reach / grid.d_phi;
  const int first = splat.row > up ? static_cast<int>(splat.row - up + 1.0f) : 0;
  const int top = static_cast<int>(splat.row + up), last = top < grid.n_elevation ? top : grid.n_elevation - 1;
  const int turns = 8 * grid.n_azimuth;  // keeps what is truncated above 0
  for (int e = first; e <= last; ++e) {
    const float c = splat.column - grid.stagger[e];  // from -1 to n_azimuth
    int left = static_cast<int>(c - across + turns + 1.0f) - turns;
    int right = static_cast<int>(c + across + turns) - turns;
    if (right - left >= grid.n_azimuth) {
      left = 0;
      right = grid.n_azimuth - 1;
    }
    for (int a = left; a <= right; ++a) {
      const float turned = (a - c) * grid.d_phi, turned2 = turned * turned;
      // cos to 2e-3 within a radian, as far as a splat reaches that does not surround the camera.
      const float cosine = 1.0f - turned2 * (0.5f - turned2 * (1.0f / 24.0f));
      if (cosine < 0.2f) continue;
      if (n_hits == room) return -1;
      const int wrapped = a < 0 ? a + grid.n_azimuth : (a >= grid.n_azimuth ? a - grid.n_azimuth : a);
      hits[n_hits++] = {sort_key(splat.rho * cosine, splat.map_row),
                        static_cast<std::uint32_t>(e * grid.n_azimuth + wrapped)};
    }
  }
  return n_hits;
}

static std::int64_t hit_rays(const RayBlock& block, const float* from, const RayGrid& grid, RayHit* hits,
                             std::int64_t room) {
  constexpr float PI_ROUNDED = 3.14159265f;
  constexpr float SLACK = 1.1f;  // an angle for its tangent, its own ray's depth, and the logarithm's error
  const float per_tan = 1.0f / grid.d_tan, per_phi = 1.0f / grid.d_phi;
  const float nearest2 = NEAREST_M * NEAREST_M, range2 = grid.range * grid.range, per_focal = 1.0f / grid.focal_px;
  const VFloat last_row = splat_all(grid.n_elevation - 1.0f);
  alignas(64) float rows[LANES], columns[LANES], reaches[LANES], rhos[LANES], depths[LANES];
  alignas(64) std::int32_t bins[LANES];
  std::int64_t n_hits = 0;
  for (int base = 0; base < block.n; base += LANES) {
    const VFloat x = load(block.x + base) - from[0], y = load(block.y + base) - from[1];
    const VFloat z = load(block.z + base) - from[2], decay = load(block.decay + base);
    const VFloat rho2 = x * x + y * y;
    VInt kept = (rho2 > nearest2) & (rho2 < range2) & (decay > 0.0f);
    if (!any(kept)) continue;
    const VFloat rho = vsqrt(vmax(rho2, splat_all(nearest2))), per_rho = 1.0f / rho;
    const VFloat sigma = grid.focal_px * load(block.radius + base) * per_rho;
    const VFloat reach = SLACK * per_focal * vsqrt(vmax(decay, VFloat{}) * (sigma * sigma + grid.low_pass_px2));
    const VFloat row = (z * per_rho - grid.tan_low) * per_tan - 0.5f;
    const VFloat reach_rows = reach * per_tan;
    kept &= (row + reach_rows >= 0.0f) & (row - reach_rows <= last_row);
    // Most are far smaller than the spaces between rays: they touch the nearest ray or none.
    const VInt nearest_row = to_cell(vmin(vmax(row, VFloat{}), last_row) + 0.5f);
    const VFloat off_row = row - to_float(nearest_row);
    const VFloat reach_columns = reach * per_phi;
    const VInt small = (reach_rows < 0.5f) & (reach_columns < 0.5f);
    kept &= ~small | ((off_row <= reach_rows) & (off_row >= -reach_rows));
    if (!any(kept)) continue;
    const VFloat column = (vatan2(y, x) + PI_ROUNDED) * per_phi;
    const VFloat off_stagger = column - gather(grid.stagger, nearest_row, kept);
    const VInt nearest_column = to_cell(off_stagger + 0.5f);
    const VFloat off_column = off_stagger - to_float(nearest_column);
    const VFloat aside = grid.focal_px * grid.d_phi * off_column, below = grid.focal_px * grid.d_tan * off_row;
    const VInt touches = aside * aside + below * below <= SLACK * decay * (sigma * sigma + grid.low_pass_px2);
    const VInt hit = kept & small & touches, large = kept & ~small;
    if (any(hit)) {
      const VFloat turned = off_column * grid.d_phi;
      store(depths, rho * (1.0f - 0.5f * turned * turned));
      const VInt wrapped = nearest_column < 0                 ? nearest_column + grid.n_azimuth
                           : nearest_column >= grid.n_azimuth ? nearest_column - grid.n_azimuth
                                                              : nearest_column;
      store(bins, nearest_row * grid.n_azimuth + wrapped);
      if (room - n_hits < LANES) return -1;
      for (std::uint32_t bits = lane_bits(hit); bits != 0; bits &= bits - 1) {
        const auto lane = static_cast<std::uint32_t>(__builtin_ctz(bits));
        hits[n_hits++] = {sort_key(depths[lane], block.first_row + static_cast<std::uint32_t>(base) + lane),
                          static_cast<std::uint32_t>(bins[lane])};
      }
    }
    if (!any(large)) continue;
    store(rows, row);
    store(columns, column);
    store(reaches, reach);
    store(rhos, rho);
    for (std::uint32_t bits = lane_bits(large); bits != 0; bits &= bits - 1) {
      const int lane = __builtin_ctz(bits);
      const LargeSplat splat{rows[lane], columns[lane], reaches[lane], rhos[lane],
                             block.first_row + static_cast<std::uint32_t>(base + lane)};
      n_hits = hit_rays_around(splat, grid, hits, n_hits, room);
      if (n_hits < 0) return -1;
    }
  }
  return n_hits;
}

}  // namespace hgs::HGS_VARIANT

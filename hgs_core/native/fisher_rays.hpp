// The exact Fisher score along sampled rays: what every instruction-set variant provides for it.
#pragma once
#include <cstdint>

namespace hgs {

// The rays of a panorama: row e at tangent tan_low + (e + 0.5) d_tan, column a at azimuth (a + stagger[e]) d_phi - pi.
struct RayGrid {
  std::int32_t n_azimuth, n_elevation;
  float tan_low, d_tan, d_phi;
  const float* stagger;  // (n_elevation), 0 .. 1
  float range;           // horizontal [m]
  float focal_px, low_pass_px2;
};

// Up to BLOCK Gaussians, column by column.
struct RayBlock {
  float x[256 + 16], y[256 + 16], z[256 + 16];  // + 16: columns not a power of two apart
  float radius[256 + 16];
  float decay[256 + 16];  // 2 ln(255 o): a splat reaches sqrt(decay) standard deviations; <= 0 where it is too faint
  std::int32_t n;
  std::uint32_t first_row;
};

// A Gaussian that may touch a ray. Sorting by `key` sorts by depth, then by row.
struct RayHit {
  std::uint64_t key;  // (bits of the depth along the ray's azimuth [m], positive) << 32 | row in the map
  std::uint32_t ray;  // row * n_azimuth + column
};

// Appends the hits of a block seen from a place to `hits`, which has room for `room`; returns how many there are,
// or -1 when there is no room (what was written is then void).
using HitRays = std::int64_t (*)(const RayBlock& block, const float* from, const RayGrid& grid, RayHit* hits,
                                 std::int64_t room);
using PrepareRayBlock = void (*)(const float* parameters, std::int32_t n, RayBlock& block);

}  // namespace hgs

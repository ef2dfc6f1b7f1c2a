// Averages depth images into the centres of the Gaussians that they show again.
#pragma once
#include <cstdint>
#include <vector>

namespace hgs {

struct FusionView {
  const float* depth;  // (height, width) z-depth [m], smoothed
  int width, height;
  float fx, fy, cx, cy;
  float rotation[9];     // world from camera, row major
  float translation[3];  // camera centre [m]
};

// How large a Gaussian the present view would place at a depth: `factor` times its lattice spacing. The lattice
// has `finest_px` pixels between points, doubled while that is less than `min_spacing_m` on the surface.
struct Placement {
  float factor, finest_px, min_spacing_m;
  float replace_factor;  // a radius so many times larger is coarse
};

// For every Gaussian whose centre projects into the image and lies within `gate_m` of the measured depth
// (grown with distance by `gate_slope`), moves the centre along the viewing ray to the running mean of the
// depths seen so far, at most `max_count` of them. Rows whose radius is coarse
// beside what this view would place are returned in `coarse_rows`, ascending.
// `bounds` holds 6 floats a block of `block` rows.
void fuse_centres(float* parameters, std::uint16_t* counts, long n, const float* bounds, int block,
                  const FusionView& view, float gate_m, float gate_slope, int max_count,
                  const Placement& placement, std::vector<std::int32_t>& coarse_rows);

}  // namespace hgs

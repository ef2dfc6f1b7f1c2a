// Averages depth images into the centres of the Gaussians that they show again.
#pragma once
#include <cstdint>
#include <vector>

namespace hgs {

struct FusionView {
  const float* depth;           // (height, width) z-depth [m], smoothed
  const float* largest_radius;  // (height, width) radius [m] beyond which a Gaussian is coarse
  int width, height;
  float fx, fy, cx, cy;
  float rotation[9];     // world from camera, row major
  float translation[3];  // camera centre [m]
};

// For every Gaussian whose centre projects into the image and lies within `gate_m` of the measured depth
// (grown with distance by `gate_slope`), moves the centre along the viewing ray to the running mean of the
// depths seen so far, at most `max_count` of them. Rows that nothing hides and whose radius is coarse for the pixel
// they project to are returned in `coarse_rows`, ascending.
// `bounds` holds 6 floats a block of `block` rows.
void fuse_centres(float* parameters, std::uint16_t* counts, long n, const float* bounds, int block,
                  const FusionView& view, float gate_m, float gate_slope, int max_count,
                  std::vector<std::int32_t>& coarse_rows);

}  // namespace hgs

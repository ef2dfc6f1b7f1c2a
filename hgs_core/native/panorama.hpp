// Panoramas: what a viewpoint sees in every direction. The inner loop is what every instruction-set variant provides.
#pragma once
#include <cstdint>

namespace hgs {

// What one voxel means to a ray: its optical depth over one edge length (infinite where nothing passes), and whether
// seeing it is a gain: 0, or how many times as full of surface as unseen space is in the mean.
struct PanoramaCell {
  float optical_depth = 0.0f, unseen = 0.0f;
};

// Where in its bins a row's rays lie, 0 .. 1: by the golden ratio, so that directions spread evenly.
inline double row_stagger(std::int64_t row) {
  const double turns = 0.6180339887498949 * static_cast<double>(row + 1);
  return turns - static_cast<double>(static_cast<std::int64_t>(turns));
}

struct PanoramaCells {
  const PanoramaCell* cells;
  std::int32_t shape[3];
  std::int32_t chunks_y;
};

struct Panorama {
  std::int64_t n_azimuth, n_elevation;
  double tan_low, tan_high;  // of the elevations at the lower and upper edge
  double range;              // horizontal, in cells
  double opaque_below;       // a ray ends where less than this is left of it
  double unseen_depth;       // optical depth of a mean unseen voxel over one edge length; 0: they hide nothing
};

// Rays from one place, each to `range` of horizontal distance.
struct PanoramaRays {
  float from[3];                // in cells
  const float *dx, *dy, *dz;    // to their ends, in cells
  const float* length;          // in cells
  int n;
};

// Per ray, in units of the range: the integral of 3 T t^2 dt over unseen voxels, their number weighted with T, and
// the integral of T t^2 dt times the optical depth of unseen voxels over the range; and the first unseen voxel, -1 for none.
struct PanoramaSums {
  float *volume, *voxels, *surface;
  std::int32_t* first_unseen;
  std::uint8_t* entered;  // (chunks_x, chunks_y): set for chunks of columns that a ray comes into
};

using MarchRays = void (*)(const PanoramaCells&, const PanoramaRays&, const Panorama&, const PanoramaSums&);

}  // namespace hgs

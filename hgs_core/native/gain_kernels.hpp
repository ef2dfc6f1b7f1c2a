// What viewpoints would gain: Gaussians gathered into voxels, and panoramas marched through them.
#pragma once
#include <cstdint>

#include "voxel_traversal.hpp"

namespace hgs {

// Where a dense box of voxels lies: lower corner [m], edge [m].
struct GridPlace {
  Point lower;
  double cell;
};

struct GaussianRows {
  const float* parameters;          // (n, 8): centre, rgb, log radius, logit opacity
  const float* information;         // (n, 8): H_train
  const float* information_weight;  // (n): sum of 1 / z^2
  const float* block_bounds;        // (n_blocks, 6)
  std::int64_t n, block;
};

struct GatherRule {
  double prior;           // lambda of Eq. 9
  double focal_px;        // of the camera that the training views were taken with
  double unseen_quality;  // q_i of a Gaussian in no keyframe [m^2]
  double max_quality;     // no q_i is larger [m^2]
  double min_opacity;     // fainter Gaussians count for nothing
};

void gather_gaussians(const Grid& grid, const GridPlace& place, const GaussianRows& gaussians, const GatherRule& rule,
                      float* optical_depth, float* quality, std::int32_t* count);

// What one voxel means to a ray: its optical depth over one edge length (infinite where nothing passes); whether
// seeing it is a gain; and the quality Q_v of its Gaussians.
struct PanoramaCell {
  float optical_depth, unseen, quality;
};

struct Panorama {
  std::int64_t n_azimuth, n_elevation;
  double tan_low, tan_high;  // of the elevations at the lower and upper edge
  double range;              // horizontal, in cells
  double opaque_below;       // a ray ends where less than this is left of it
  double saturation;         // nearer than this, quality gains no more; horizontal, in cells; 0 = never
  double face_gap;           // a surface's voxels may lie so far apart along a ray and still be one face, in cells
};

void march_panoramas(const Grid& grid, const PanoramaCell* cells, const double* positions, std::int64_t n_positions,
                     const Panorama& panorama, float* unseen_volume, float* unseen_voxels, float* quality);

}  // namespace hgs

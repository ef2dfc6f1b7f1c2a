// What viewpoints would gain: Gaussians gathered into voxels, and panoramas marched through them.
#pragma once
#include <cstdint>

#include "fisher_rays.hpp"
#include "gain_rows.hpp"
#include "panorama.hpp"
#include "voxel_traversal.hpp"

namespace hgs {

// Where a dense box of voxels lies: lower corner [m], edge [m].
struct GridPlace {
  Point lower;
  double cell;
};

struct InformedMap {
  const float* parameters;    // (n, 8): centre, rgb, log radius, logit opacity
  const float* information;   // (n, 8): H_train
  const float* weight;        // (n): sum of 1 / z^2
  const float* block_bounds;  // (n_blocks, 6)
  std::int64_t n;
};

struct VoxelStates {
  const std::uint8_t* states;
  const std::uint8_t* attempts;
  std::uint8_t max_attempts;  // an unobserved voxel looked at so often in vain is dismissed
};

// Chunks of columns (see gain_rows.hpp); those not wanted stay as they are.
struct GainField {
  std::int64_t chunks[2];
  const std::uint8_t* wanted;
  PanoramaCell* cells;        // the whole grid
  std::int64_t* n_gaussians;  // in each chunk
  std::int64_t* n_populated;  // voxels of each chunk that hold any
};

void gather_gain(const Grid& grid, const GridPlace& place, const InformedMap& map, const VoxelStates& voxels,
                 const GatherRule& rule, const GainField& field);

void march_panoramas(const Grid& grid, const PanoramaCell* cells, const double* positions, std::int64_t n_positions,
                     const Panorama& panorama, float* unseen_volume, float* unseen_voxels, float* quality);

// sums[i, k] = sum over e, m of window[e, m] * panoramas[i, e, (k + m) mod n_azimuth].
void slide_window(const float* panoramas, std::int64_t n, std::int64_t n_rows, std::int64_t n_azimuth,
                  const double* window, double* sums);

struct FisherRule {
  float prior;         // lambda of Eq. 9
  float focal_px;      // of the camera that is to look
  float low_pass_px2;
  float saturation_m;  // nearer than this, a Gaussian scores as from here; 0 = never
};

// The exact score along each ray of the panoramas of n places, per pixel: score (n, elevation, azimuth). `positions`
// and `panorama.range` in metres; `panorama` needs its directions and range only.
void sample_fisher(const InformedMap& map, const double* positions, std::int64_t n_positions, const Panorama& panorama,
                   const FisherRule& rule, float* score);

}  // namespace hgs

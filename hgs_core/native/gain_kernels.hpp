// What viewpoints would cover: Gaussians gathered into voxels, and panoramas marched through them.
#pragma once
#include <cstdint>
#include <vector>

#include "gain_rows.hpp"
#include "panorama.hpp"
#include "rasterise.hpp"
#include "voxel_traversal.hpp"

namespace hgs {

// Where a dense box of voxels lies: lower corner [m], edge [m].
struct GridPlace {
  Point lower;
  double cell;
};

// Chunks of columns (see gain_rows.hpp), and which of them work is to be done for.
struct WantedChunks {
  std::int64_t shape[2];
  const std::uint8_t* wanted;
};

// The first rows of the blocks with Gaussians in wanted chunks, perhaps.
std::vector<std::int64_t> blocks_in(const GaussianRows& map, const GridPlace& place, const WantedChunks& chunks);

struct VoxelStates {
  const std::uint8_t* states;
  const std::uint8_t* attempts;
  std::uint8_t max_attempts;  // an unobserved voxel looked at so often in vain is dismissed
};

// Chunks that are not wanted stay as they are.
struct GainField {
  WantedChunks chunks;
  PanoramaCell* cells;        // the whole grid
  std::int64_t* n_gaussians;  // in each chunk
  std::int64_t* n_populated;  // voxels of each chunk that hold any
};

void gather_gain(const Grid& grid, const GridPlace& place, const GaussianRows& map, const VoxelStates& voxels,
                 float min_opacity, const GainField& field);

void march_panoramas(const Grid& grid, const PanoramaCell* cells, const double* positions, std::int64_t n_positions,
                     const Panorama& panorama, float* unseen_volume, float* unseen_voxels, float* new_surface,
                     std::int32_t* first_unseen, std::uint8_t* entered);

// sums[i, k] = sum over e, m of window[e, m] * panoramas[i, e, (k + m) mod n_azimuth].
void slide_window(const float* panoramas, std::int64_t n, std::int64_t n_rows, std::int64_t n_azimuth,
                  const double* window, double* sums);

}  // namespace hgs

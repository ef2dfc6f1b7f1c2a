// The work on single Gaussians of `gather_gain`: what every instruction-set variant provides.
#pragma once
#include <cstdint>

namespace hgs {

// Where voxels lie, and which columns of them are wanted. A chunk is CHUNK x CHUNK columns.
inline constexpr int CHUNK_SHIFT = 4;
inline constexpr int CHUNK = 1 << CHUNK_SHIFT;

struct GatherBox {
  float lower[3];  // [m]
  float cell;      // [m]
  std::int32_t shape[3];
  std::int32_t chunks_y;
  const std::uint8_t* wanted;  // (chunks_x, chunks_y)
};

// What a Gaussian adds to its voxel.
struct GatherEntry {
  std::int32_t voxel;
  float optical_depth;
};

// Writes an entry for each of n rows (centre, rgb, log radius, logit opacity) that lies in a wanted chunk and is no
// fainter than `min_opacity`; returns how many.
using GatherRows = int (*)(const float* parameters, int n, const GatherBox& box, float min_opacity,
                           GatherEntry* entries);

}  // namespace hgs

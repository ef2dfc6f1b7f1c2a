// The work on single Gaussians of `gather_gain`: what every instruction-set variant provides.
#pragma once
#include <cstdint>

namespace hgs {

// A run of rows of the map.
struct InformedRows {
  const float* parameters;   // (n, 8): centre, rgb, log radius, logit opacity
  const float* information;  // (n, 8): H_train
  const float* weight;       // (n): sum of 1 / z^2
  int n;
};

struct GatherRule {
  float prior;           // lambda of Eq. 9
  float focal_px;        // of the camera that the training views were taken with
  float unseen_quality;  // q_i of a Gaussian in no keyframe [m^2]
  float max_quality;     // no q_i is larger [m^2]
  float min_opacity;     // fainter Gaussians count for nothing
};

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
  float optical_depth, quality;
};

struct InformationSums {
  double held = 0.0;      // colour information
  double possible = 0.0;  // the same if nothing covered anything
};

// Writes an entry for each row that lies in a wanted chunk; returns how many.
using GatherRows = int (*)(const InformedRows& rows, const GatherBox& box, const GatherRule& rule,
                           float uncovered_share, GatherEntry* entries);
using SumInformation = InformationSums (*)(const InformedRows& rows, const GatherRule& rule);

}  // namespace hgs

// What the Gaussian map knows of a layer above the floor.
#pragma once
#include <cstdint>

namespace hgs {

struct GaussianRows;

// Heights low < z < high [m] over a floor plan of nx x ny cells, and the least opacity that counts.
struct FloorLayer {
  float low, high, min_logit_opacity;
  double lower[2], cell;  // [m]
  std::int64_t nx, ny;
};

// Adds the centres in each cell's part of the layer to `counts` (nx, ny). Blocks of the map that do not reach into
// the layer are not looked at.
void count_in_layer(const GaussianRows& gaussians, const FloorLayer& layer, std::int32_t* counts);

// The same of those in `cells` (nx, ny) that lie nearer than `reach`, in cells, to the middle of any of `places`
// (nx, ny).
void count_in_reach(const GaussianRows& gaussians, const FloorLayer& layer, const std::uint8_t* cells,
                    const std::uint8_t* places, double reach, std::int32_t* counts);

}  // namespace hgs

// Gaussians of a layer above the floor, counted by the cells of a floor plan.
#include <algorithm>
#include <cmath>

#include "floor_layer.hpp"
#include "rasterise.hpp"

namespace hgs {

void count_in_layer(const GaussianRows& gaussians, const FloorLayer& layer, std::int32_t* counts) {
  const double upper[2] = {layer.lower[0] + layer.nx * layer.cell, layer.lower[1] + layer.ny * layer.cell};
  const auto n_blocks = static_cast<std::int64_t>((gaussians.n + BLOCK - 1) / BLOCK);
  for (std::int64_t b = 0; b < n_blocks; ++b) {
    const float* bounds = gaussians.block_bounds + 6 * b;
    if (bounds[2] >= layer.high || bounds[5] <= layer.low || bounds[0] >= upper[0] || bounds[3] <= layer.lower[0] ||
        bounds[1] >= upper[1] || bounds[4] <= layer.lower[1]) {
      continue;
    }
    const std::size_t last = std::min(gaussians.n, static_cast<std::size_t>(b + 1) * BLOCK);
    for (std::size_t row = static_cast<std::size_t>(b) * BLOCK; row < last; ++row) {
      const float* p = gaussians.parameters + N_PARAMETERS * row;
      if (!(p[2] > layer.low && p[2] < layer.high && p[7] > layer.min_logit_opacity)) continue;
      const double i = std::floor((p[0] - layer.lower[0]) / layer.cell);
      const double j = std::floor((p[1] - layer.lower[1]) / layer.cell);
      if (!(i >= 0 && j >= 0 && i < layer.nx && j < layer.ny)) continue;
      ++counts[static_cast<std::int64_t>(i) * layer.ny + static_cast<std::int64_t>(j)];
    }
  }
}

}  // namespace hgs

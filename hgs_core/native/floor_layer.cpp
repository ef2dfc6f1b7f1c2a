// Gaussians of a layer above the floor, counted by the cells of a floor plan.
#include <algorithm>
#include <cmath>

#include "floor_layer.hpp"
#include "rasterise.hpp"

namespace hgs {

namespace {

// Calls visit(x, y, i, j) for every solid centre in the layer: its place in cells, and the cell.
template <class Visit>
void for_each_in_layer(const GaussianRows& gaussians, const FloorLayer& layer, Visit&& visit) {
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
      const double x = (p[0] - layer.lower[0]) / layer.cell, y = (p[1] - layer.lower[1]) / layer.cell;
      if (!(x >= 0 && y >= 0 && x < layer.nx && y < layer.ny)) continue;
      visit(x, y, static_cast<std::int64_t>(x), static_cast<std::int64_t>(y));
    }
  }
}

bool in_reach(double x, double y, const FloorLayer& layer, const std::uint8_t* places, double reach) {
  const auto first = [](double a) { return static_cast<std::int64_t>(std::ceil(std::max(a, 0.0))); };
  const auto last = [](double a, std::int64_t n) {
    return std::min(static_cast<std::int64_t>(std::floor(a)), n - 1);
  };
  for (std::int64_t i = first(x - reach - 0.5); i <= last(x + reach - 0.5, layer.nx); ++i) {
    for (std::int64_t j = first(y - reach - 0.5); j <= last(y + reach - 0.5, layer.ny); ++j) {
      const double dx = x - (i + 0.5), dy = y - (j + 0.5);
      if (places[i * layer.ny + j] != 0 && dx * dx + dy * dy < reach * reach) return true;
    }
  }
  return false;
}

}  // namespace

void count_in_layer(const GaussianRows& gaussians, const FloorLayer& layer, std::int32_t* counts) {
  for_each_in_layer(gaussians, layer, [&](double, double, std::int64_t i, std::int64_t j) {
    ++counts[i * layer.ny + j];
  });
}

void count_in_reach(const GaussianRows& gaussians, const FloorLayer& layer, const std::uint8_t* cells,
                    const std::uint8_t* places, double reach, std::int32_t* counts) {
  for_each_in_layer(gaussians, layer, [&](double x, double y, std::int64_t i, std::int64_t j) {
    if (cells[i * layer.ny + j] != 0 && in_reach(x, y, layer, places, reach)) ++counts[i * layer.ny + j];
  });
}

}  // namespace hgs

// What lies behind the surfaces that a depth image shows: a third of what the frustum holds of a house.
#include <algorithm>

#include "rasterise_workspace.hpp"

namespace hgs {

TileLimits tile_limits(const float* depth, const PinholeCamera& camera, Workspace& workspace) {
  const int tiles_x = (camera.width + TILE_W - 1) / TILE_W, tiles_y = (camera.height + TILE_H - 1) / TILE_H;
  const int n = tiles_x * tiles_y;
  float* of_tile = workspace.tile_limits.require(std::size_t{3} * n);
  float *nearest = of_tile + n, *farthest = nearest + n;
#pragma omp parallel
  {
#pragma omp for schedule(static)
    for (int tile = 0; tile < n; ++tile) {
      const int x0 = tile % tiles_x * TILE_W, y0 = tile / tiles_x * TILE_H;
      const int x1 = std::min(x0 + TILE_W, camera.width), y1 = std::min(y0 + TILE_H, camera.height);
      float most = 0.0f;
      for (int y = y0; y < y1; ++y) {
        const float* row = depth + std::size_t{1} * y * camera.width;
        for (int x = x0; x < x1; ++x) most = std::max(most, row[x] > 0.0f ? row[x] : __builtin_inff());
      }
      of_tile[tile] = most + BEHIND_M;
    }
#pragma omp for schedule(static)
    for (int tile = 0; tile < n; ++tile) {
      const int x0 = tile % tiles_x, y0 = tile / tiles_x;
      const int x1 = std::min(x0 + SPAN, tiles_x), y1 = std::min(y0 + SPAN, tiles_y);
      float least = __builtin_inff(), most = 0.0f;
      for (int y = y0; y < y1; ++y) {
        for (int x = x0; x < x1; ++x) {
          least = std::min(least, of_tile[y * tiles_x + x]);
          most = std::max(most, of_tile[y * tiles_x + x]);
        }
      }
      nearest[tile] = least;
      farthest[tile] = most;
    }
  }
  return {tiles_x, tiles_y, of_tile, nearest, farthest};
}

bool TileLimits::hide(float left, float top, float right, float bottom, float z) const {
  const auto tile_of = [](float pixel, int size, int most) {
    return static_cast<int>(std::min(std::max(pixel / static_cast<float>(size), 0.0f), static_cast<float>(most)));
  };
  const int x0 = tile_of(left, TILE_W, tiles_x - 1), x1 = tile_of(right, TILE_W, tiles_x - 1);
  const int y0 = tile_of(top, TILE_H, tiles_y - 1), y1 = tile_of(bottom, TILE_H, tiles_y - 1);
  for (int y = y0; y <= y1; y += SPAN) {
    for (int x = x0; x <= x1; x += SPAN) {
      if (!(z >= farthest[y * tiles_x + x])) return false;
    }
  }
  return true;
}

}  // namespace hgs

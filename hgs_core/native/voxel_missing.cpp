// Which voxels are missing: unobserved, with a free face-neighbour, looked at in vain fewer than
// `max_attempts` times, in 26-connected clusters of at least `min_cluster`.
#include <algorithm>
#include <vector>

#include "voxel_kernels.hpp"

namespace hgs {

void missing_voxels(const Grid& grid, const std::uint8_t* states, const std::uint8_t* attempts,
                    std::uint8_t max_attempts, std::int64_t min_cluster, bool* missing) {
  const auto [nx, ny, nz] = grid.shape;
#pragma omp parallel for schedule(static)
  for (std::int64_t i = 0; i < nx; ++i) {
    for (std::int64_t j = 0; j < ny; ++j) {
      for (std::int64_t k = 0; k < nz; ++k) {
        const std::int64_t v = grid.offset({i, j, k});
        const auto is_free = [&](bool inside, std::int64_t step) { return inside && states[v + step] == kFree; };
        missing[v] = states[v] == kUnobserved && attempts[v] < max_attempts &&
                     (is_free(k > 0, -1) || is_free(k + 1 < nz, 1) || is_free(j > 0, -nz) || is_free(j + 1 < ny, nz) ||
                      is_free(i > 0, -ny * nz) || is_free(i + 1 < nx, ny * nz));
      }
    }
  }
  if (min_cluster <= 1) return;

  // Flood each cluster once; drop it when it turns out too small.
  std::vector<bool> seen(static_cast<std::size_t>(nx * ny * nz), false);
  std::vector<Cell> cluster;
  for (std::int64_t i = 0; i < nx; ++i) {
    for (std::int64_t j = 0; j < ny; ++j) {
      for (std::int64_t k = 0; k < nz; ++k) {
        const std::int64_t seed = grid.offset({i, j, k});
        if (!missing[seed] || seen[seed]) continue;
        cluster.assign(1, Cell{i, j, k});
        seen[seed] = true;
        for (std::size_t next = 0; next < cluster.size(); ++next) {
          const Cell c = cluster[next];
          for (std::int64_t x = std::max<std::int64_t>(c[0] - 1, 0); x <= std::min(c[0] + 1, nx - 1); ++x) {
            for (std::int64_t y = std::max<std::int64_t>(c[1] - 1, 0); y <= std::min(c[1] + 1, ny - 1); ++y) {
              for (std::int64_t z = std::max<std::int64_t>(c[2] - 1, 0); z <= std::min(c[2] + 1, nz - 1); ++z) {
                const std::int64_t v = grid.offset({x, y, z});
                if (!missing[v] || seen[v]) continue;
                seen[v] = true;
                cluster.push_back({x, y, z});
              }
            }
          }
        }
        if (static_cast<std::int64_t>(cluster.size()) >= min_cluster) continue;
        for (const Cell& c : cluster) missing[grid.offset(c)] = false;
      }
    }
  }
}

}  // namespace hgs

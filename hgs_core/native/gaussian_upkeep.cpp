#include "gaussian_upkeep.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace hgs {
namespace {

bool near_surface(const Grid& grid, const std::uint8_t* states, const Cell& c) {
  Cell low, high;
  for (std::size_t a = 0; a < 3; ++a) {
    low[a] = std::max<std::int64_t>(c[a] - 1, 0);
    high[a] = std::min(c[a] + 1, grid.shape[a] - 1);
  }
  for (std::int64_t i = low[0]; i <= high[0]; ++i)
    for (std::int64_t j = low[1]; j <= high[1]; ++j)
      for (std::int64_t k = low[2]; k <= high[2]; ++k)
        if (states[grid.offset({i, j, k})] == kOccupied) return true;
  return false;
}

// The cell of a Gaussian's centre in the arrays; it may lie beyond them.
Cell cell_of_row(const float* p, const VoxelPlace& place) {
  Point cells;
  for (std::size_t a = 0; a < 3; ++a) cells[a] = static_cast<double>(p[a]) / place.size_m;
  Cell c = cell_of(cells);
  for (std::size_t a = 0; a < 3; ++a) c[a] -= place.origin[a];
  return c;
}

}  // namespace

void bound_blocks(const float* parameters, std::int64_t n, std::int64_t block, float* bounds) {
  const std::int64_t n_blocks = (n + block - 1) / block;
#pragma omp parallel for schedule(static)
  for (std::int64_t b = 0; b < n_blocks; ++b) {
    const float* first = parameters + 8 * block * b;
    float low[3] = {first[0], first[1], first[2]}, high[3] = {first[0], first[1], first[2]};
    float log_radius = first[6];
    for (std::int64_t row = b * block + 1; row < std::min(n, (b + 1) * block); ++row) {
      const float* p = parameters + 8 * row;
      for (int a = 0; a < 3; ++a) {
        low[a] = std::min(low[a], p[a]);
        high[a] = std::max(high[a], p[a]);
      }
      log_radius = std::max(log_radius, p[6]);
    }
    const float radius = std::exp(log_radius);
    for (int a = 0; a < 3; ++a) {
      bounds[6 * b + a] = low[a] - radius;
      bounds[6 * b + 3 + a] = high[a] + radius;
    }
  }
}

void compact_rows(std::uint8_t* rows, std::int64_t n, std::int64_t row_bytes, const bool* kept) {
  std::int64_t n_kept = 0;
  for (std::int64_t first = 0; first < n;) {
    if (!kept[first]) {
      ++first;
      continue;
    }
    std::int64_t end = first + 1;
    while (end < n && kept[end]) ++end;
    if (n_kept != first) {
      std::memmove(rows + n_kept * row_bytes, rows + first * row_bytes, static_cast<std::size_t>((end - first) * row_bytes));
    }
    n_kept += end - first;
    first = end;
  }
}

void flag_worth_keeping(const float* parameters, std::int64_t n, float min_logit_opacity, const Grid& grid,
                        const std::uint8_t* states, const VoxelPlace& place, bool* kept) {
#pragma omp parallel for schedule(static)
  for (std::int64_t row = 0; row < n; ++row) {
    const float* p = parameters + 8 * row;
    kept[row] = p[7] >= min_logit_opacity;
    if (!kept[row]) continue;
    const Cell c = cell_of_row(p, place);
    if (grid.contains(c) && states[grid.offset(c)] == kFree) kept[row] = near_surface(grid, states, c);
  }
}

void count_by_voxel(const float* parameters, std::int64_t n, float min_logit_opacity, const Grid& grid,
                    const VoxelPlace& place, std::int32_t* counts) {
  for (std::int64_t row = 0; row < n; ++row) {
    const float* p = parameters + 8 * row;
    if (p[7] < min_logit_opacity) continue;
    const Cell c = cell_of_row(p, place);
    if (grid.contains(c)) ++counts[grid.offset(c)];
  }
}

}  // namespace hgs

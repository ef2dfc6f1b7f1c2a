// Cells of a grid counted in discs.
#include <algorithm>
#include <cmath>

#include "grid_kernels.hpp"
#include "whole_number.hpp"

namespace hgs {

void grid_count_in_discs(const uint8_t* flags, int nx, int ny, const double* points, int n_points, double radius,
                         int64_t* counts) {
  for (int p = 0; p < n_points; ++p) {
    const double x = points[2 * p] - 0.5, y = points[2 * p + 1] - 0.5;  // of cell (0, 0)'s centre
    const int i0 = floor_within(std::ceil(x - radius), 0, nx);
    const int i1 = floor_within(x + radius, -1, nx - 1);
    int64_t n = 0;
    for (int i = i0; i <= i1; ++i) {
      const double half = std::sqrt(std::max(0.0, radius * radius - (i - x) * (i - x)));
      const int j0 = floor_within(std::ceil(y - half), 0, ny);
      const int j1 = floor_within(y + half, -1, ny - 1);
      const uint8_t* row = flags + static_cast<size_t>(i) * ny;
      for (int j = j0; j <= j1; ++j) n += row[j] != 0;
    }
    counts[p] = n;
  }
}

}  // namespace hgs

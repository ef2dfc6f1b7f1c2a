// Columns of a voxel map summed over height.
#include "voxel_kernels.hpp"

namespace hgs {

void count_in_columns(const Grid& grid, const std::uint8_t* values, const Cell& low, const Cell& high,
                      std::int32_t* counts) {
  const std::int64_t n_y = high[1] - low[1];
#pragma omp parallel for schedule(static)
  for (std::int64_t i = low[0]; i < high[0]; ++i) {
    for (std::int64_t j = low[1]; j < high[1]; ++j) {
      const std::uint8_t* column = values + grid.offset({i, j, 0});
      std::int32_t n_1 = 0, n_2 = 0;
      for (std::int64_t k = low[2]; k < high[2]; ++k) {
        n_1 += column[k] == 1;
        n_2 += column[k] == 2;
      }
      std::int32_t* out = counts + 3 * ((i - low[0]) * n_y + (j - low[1]));
      out[0] = static_cast<std::int32_t>(high[2] - low[2]) - n_1 - n_2;
      out[1] = n_1;
      out[2] = n_2;
    }
  }
}

}  // namespace hgs

// Poisson-disk samples by dart throwing.
#include <vector>

#include "grid_kernels.hpp"

namespace hgs {

int throw_darts(const double* points, const int64_t* order, int n_points, const double* taken, int n_taken,
                double spacing, int limit, int64_t* chosen) {
  const double nearest2 = spacing * spacing;
  const auto is_free = [&](const double* p, const double* others, int n) {
    for (int k = 0; k < n; ++k) {
      const double dx = p[0] - others[2 * k], dy = p[1] - others[2 * k + 1];
      if (dx * dx + dy * dy < nearest2) return false;
    }
    return true;
  };
  std::vector<double> thrown;
  int n_chosen = 0;
  for (int k = 0; k < n_points && n_chosen < limit; ++k) {
    const double* p = points + 2 * order[k];
    if (!is_free(p, thrown.data(), n_chosen) || !is_free(p, taken, n_taken)) continue;
    thrown.push_back(p[0]);
    thrown.push_back(p[1]);
    chosen[n_chosen++] = order[k];
  }
  return n_chosen;
}

}  // namespace hgs

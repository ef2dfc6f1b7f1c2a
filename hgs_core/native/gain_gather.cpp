// Gaussians gathered into the voxels that hold their centres.
//
//   optical depth of a voxel   tau = sum_i o_i 2 pi r_i^2 / face area
//     (the integral of o exp(-d^2 / 2 r^2) over a plane is 2 pi o r^2: tau is the mean over a face of what
//      one crossing of the voxel meets)
//   quality of a voxel         Q = sum_i q_i,   q_i = sum_k I_ik / (I_ik + prior) / w_i
//     (I_ik: H_train, w_i: sum of 1 / z^2 over the keyframes that saw i, so I_ik / w_i / d^2 is what one more view
//      from distance d is expected to add, and q_i / d^2 is the gain of Eq. 9 in its trace form)
//
// The per-Gaussian part runs in parallel; the sums run in row order, so they do not depend on the threads.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "gain_kernels.hpp"

namespace hgs {

void gather_gaussians(const Grid& grid, const GridPlace& place, const GaussianRows& gaussians, const GatherRule& rule,
                      float* optical_depth, float* quality, std::int32_t* count) {
  struct Share {
    std::int64_t voxel;
    float optical_depth, quality;
  };
  const double face = place.cell * place.cell;
  const double unseen_quality = 8.0 * rule.unseen_distance * rule.unseen_distance;

  std::vector<std::int64_t> blocks;
  for (std::int64_t b = 0; b * gaussians.block < gaussians.n; ++b) {
    const float* bounds = gaussians.block_bounds + 6 * b;
    bool near = true;
    for (int a = 0; a < 3; ++a) {
      near = near && bounds[3 + a] >= place.lower[a] && bounds[a] <= place.lower[a] + grid.shape[a] * place.cell;
    }
    if (near) blocks.push_back(b);
  }

  const auto n_blocks = static_cast<std::int64_t>(blocks.size());
  std::vector<Share> shares(static_cast<std::size_t>(n_blocks * gaussians.block), Share{-1, 0.0f, 0.0f});
#pragma omp parallel for schedule(static)
  for (std::int64_t b = 0; b < n_blocks; ++b) {
    const std::int64_t first = blocks[b] * gaussians.block;
    const std::int64_t last = std::min(first + gaussians.block, gaussians.n);
    for (std::int64_t i = first; i < last; ++i) {
      const float* p = gaussians.parameters + 8 * i;
      const double opacity = 1.0 / (1.0 + std::exp(-static_cast<double>(p[7])));
      if (opacity < rule.min_opacity) continue;
      Point at;
      for (int a = 0; a < 3; ++a) at[a] = (p[a] - place.lower[a]) / place.cell;
      const Cell cell = cell_of(at);
      if (!grid.contains(cell)) continue;
      const double radius = std::exp(static_cast<double>(p[6]));
      double q = 0.0;
      const double weight = gaussians.information_weight[i];
      if (weight > 0.0) {
        for (int k = 0; k < 8; ++k) {
          const double information = gaussians.information[8 * i + k];
          q += information / (information + rule.prior);
        }
        q /= weight;
      } else {
        q = unseen_quality;
      }
      shares[b * gaussians.block + (i - first)] = {
          grid.offset(cell), static_cast<float>(opacity * 2.0 * std::numbers::pi * radius * radius / face),
          static_cast<float>(q)};
    }
  }
  for (const Share& s : shares) {
    if (s.voxel < 0) continue;
    optical_depth[s.voxel] += s.optical_depth;
    quality[s.voxel] += s.quality;
    ++count[s.voxel];
  }
}

}  // namespace hgs

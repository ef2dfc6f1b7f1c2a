// Gaussians gathered into the voxels that hold their centres.
//
//   optical depth of a voxel   tau = sum_i o_i 2 pi r_i^2 / face area
//     (the integral of o exp(-d^2 / 2 r^2) over a plane is 2 pi o r^2: tau is the mean over a face of what
//      one crossing of the voxel meets)
//
//   quality of a voxel         Q = sum_i q_i,   q_i = (c_i / I_i,colour) sum_k I_ik / (I_ik + prior)
//     I_ik is H_train. One more view is expected to hold information in proportion to what the training views hold,
//     H_cand,ik = I_ik c_i / (I_i,colour d^2), so q_i / d^2 is the gain of Eq. 9 in its trace form. c_i is the
//     colour information expected from 1 m: colour information is sum (alpha T)^2 over pixels, which for a
//     Gaussian of opacity o and screen radius f r / d that nothing covers is pi o^2 (f r / d)^2. Its neighbours on the
//     surface always cover it partly; the share that is left, s, is measured on the training views of all
//     Gaussians gathered:
//       c_i = s pi o_i^2 (f r_i)^2,   s = sum_i I_i,colour / sum_i w_i pi o_i^2 (f r_i)^2,   w_i = sum 1 / z^2
//     So a Gaussian that its training views saw at a grazing angle, or half hidden, is worth a view although they
//     were near: each single view counts for what it held, not for its distance.
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
    std::int64_t voxel = -1;
    double optical_depth = 0.0;
    double uncovered = 0.0;  // colour information from 1 m if nothing covered it
    double colour = 0.0;     // colour information held
    double weight = 0.0;
    double settled = 0.0;  // sum_k I_ik / (I_ik + prior)
  };
  constexpr double kPi = std::numbers::pi;
  const double face = place.cell * place.cell;

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
  std::vector<Share> shares(static_cast<std::size_t>(n_blocks * gaussians.block));
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
      const float* information = gaussians.information + 8 * i;
      Share& share = shares[b * gaussians.block + (i - first)];
      share.voxel = grid.offset(cell);
      share.optical_depth = opacity * 2.0 * kPi * radius * radius / face;
      share.uncovered = kPi * opacity * opacity * radius * radius * rule.focal_px * rule.focal_px;
      share.colour = (information[3] + information[4] + information[5]) / 3.0;
      share.weight = gaussians.information_weight[i];
      for (int k = 0; k < 8; ++k) share.settled += information[k] / (information[k] + rule.prior);
    }
  }

  double held = 0.0, possible = 0.0;
  for (const Share& s : shares) {
    held += s.colour;
    possible += s.weight * s.uncovered;
  }
  const double uncovered_share = possible > 0.0 ? held / possible : 0.0;
  for (const Share& s : shares) {
    if (s.voxel < 0) continue;
    double q = rule.unseen_quality;
    if (s.weight > 0.0 && s.colour > 0.0) {
      q = std::min(uncovered_share * s.uncovered / s.colour * s.settled, rule.max_quality);
    }
    optical_depth[s.voxel] += static_cast<float>(s.optical_depth);
    quality[s.voxel] += static_cast<float>(q);
    ++count[s.voxel];
  }
}

}  // namespace hgs

// From sums over pixels to the eight parameters of a Gaussian, and Adam.
// Included only by the variant files (see simd.hpp).
//
// With e = -d^2 / (2 sigma^2), k = 1 / (2 sigma^2) and s^2 = (f r / z)^2, by a parameter theta:
//   de/dtheta = 2k dx du/dtheta + 2k dy dv/dtheta + 2k^2 d^2 ds^2/dtheta
//   camera x:   du = fx / z                          camera y: dv = fy / z
//   camera z:   du = -(u - cx) / z, dv = -(v - cy) / z, ds^2 = -2 s^2 / z
//   log radius: ds^2 = 2 s^2                         logit opacity: dlog(a) = 1 - o
// A centre in the world: camera coordinates = R c + t, so its derivatives are R^T of those.
#pragma once
#include "rasterise_information.hpp"

namespace hgs::HGS_VARIANT {

// Coefficients of dx, dy and d^2 in de/dtheta: d/dx = dx x, d/dy = dy y, d/dz = dx z_dx + dy z_dy + d^2 z_d2 in the
// camera's frame, and d^2 alone for the log radius.
struct ExponentSlopes {
  float x, y, z_dx, z_dy, z_d2;
  float log_radius;
};

HGS_INLINE ExponentSlopes exponent_slopes(const Splat& splat, const PinholeCamera& camera) {
  const float k = splat.falloff * 0.69314718f;
  const float two_k = 2.0f * k, inverse_z = 1.0f / splat.z;
  const float by_variance = two_k * k * 2.0f * splat.own_variance;
  return {two_k * camera.fx * inverse_z,
          two_k * camera.fy * inverse_z,
          -two_k * (splat.u - camera.cx) * inverse_z,
          -two_k * (splat.v - camera.cy) * inverse_z,
          -by_variance * inverse_z,
          by_variance};
}

// Coefficients of (dx, dy, d^2) by the world coordinate `axis`.
HGS_INLINE void world_slopes(const ExponentSlopes& slopes, const PinholeCamera& camera, int axis, float out[3]) {
  const float* R = camera.rotation + axis;
  out[0] = R[0] * slopes.x + R[6] * slopes.z_dx;
  out[1] = R[3] * slopes.y + R[6] * slopes.z_dy;
  out[2] = R[6] * slopes.z_d2;
}

// The splat's eight sums over all its tiles.
HGS_INLINE VFloat8 gather(const float* pair_sums, std::uint32_t begin, std::uint32_t end) {
  VFloat8 total = {};
  for (std::uint32_t pair = begin; pair < end; ++pair) total += load8(pair_sums + 8 * std::size_t{pair});
  return total;
}

HGS_INLINE std::uint32_t end_of_pairs(const Workspace& workspace, std::size_t block, std::uint32_t rank) {
  const bool last = rank + 1 == workspace.block_splats.get()[block];
  return last ? workspace.pairs_before.get()[block + 1] : workspace.spans.get()[block * BLOCK + rank + 1].first_pair;
}

// Calls visit(splat, sums, state of its block) for every splat, in map order; a block is visited by one thread.
template <class BeginBlock, class Visit, class EndBlock>
HGS_INLINE void for_each_splat(const Workspace& workspace, BeginBlock&& begin_block, Visit&& visit,
                               EndBlock&& end_block) {
  const Splat* splats = workspace.splats.get();
  const TileSpan* spans = workspace.spans.get();
  const float* pair_sums = workspace.pair_sums.get();
#pragma omp parallel
  {
    const FlushDenormals flush;
#pragma omp for schedule(dynamic, 8)
    for (std::size_t block = 0; block < workspace.n_visible_blocks; ++block) {
      auto state = begin_block(block);
      for (std::uint32_t rank = 0; rank < workspace.block_splats.get()[block]; ++rank) {
        const std::size_t slot = block * BLOCK + rank;
        visit(splats[slot], gather(pair_sums, spans[slot].first_pair, end_of_pairs(workspace, block, rank)), state);
      }
      end_block(block, state);
    }
  }
}

struct Nothing {};

// The camera's axes in the world, as rows of parameters.
struct CameraAxes {
  VFloat8 x, y, z;
};

HGS_INLINE CameraAxes camera_axes(const PinholeCamera& camera) {
  const float* R = camera.rotation;
  return {VFloat8{R[0], R[1], R[2]}, VFloat8{R[3], R[4], R[5]}, VFloat8{R[6], R[7], R[8]}};
}

// By the eight parameters.
HGS_INLINE VFloat8 chain_gradient(const Splat& splat, const PinholeCamera& camera, const CameraAxes& axes,
                                  VFloat8 sums) {
  const ExponentSlopes slopes = exponent_slopes(splat, camera);
  const float along_z = slopes.z_dx * sums[SUM_P_DX] + slopes.z_dy * sums[SUM_P_DY] + slopes.z_d2 * sums[SUM_P_D2] +
                        sums[SUM_Z];
  const VFloat8 centre = axes.x * (slopes.x * sums[SUM_P_DX]) + axes.y * (slopes.y * sums[SUM_P_DY]) +
                         axes.z * along_z;
  typedef std::int32_t Lanes __attribute__((vector_size(32)));
  const VFloat8 others = __builtin_shuffle(sums, Lanes{SUM_P, SUM_P, SUM_P, SUM_R, SUM_G, SUM_B, SUM_P_D2, SUM_P});
  return centre + others * VFloat8{0.0f, 0.0f, 0.0f, 1.0f, 1.0f, 1.0f, slopes.log_radius, 1.0f - splat.opacity};
}

static void add_gradients(const Workspace& workspace, const PinholeCamera& camera, float* gradients) {
  const CameraAxes axes = camera_axes(camera);
  for_each_splat(
      workspace, [](std::size_t) { return Nothing{}; },
      [&](const Splat& splat, VFloat8 sums, Nothing&) HGS_LAMBDA {
        float* out = gradients + N_PARAMETERS * std::size_t{splat.row};
        store8(out, load8(out) + chain_gradient(splat, camera, axes, sums));
      },
      [](std::size_t, Nothing&) {});
}

// E (a . (dx, dy, d^2))^2 summed, from the moments of E.
HGS_INLINE float quadratic(const float* a, VFloat8 sums) {
  const float value = a[0] * a[0] * sums[SUM_E_XX] + a[1] * a[1] * sums[SUM_E_YY] + a[2] * a[2] * sums[SUM_E_DD] +
                      2.0f * (a[0] * a[1] * sums[SUM_E_XY] + a[0] * a[2] * sums[SUM_E_XD] +
                              a[1] * a[2] * sums[SUM_E_YD]);
  return value > 0.0f ? value : 0.0f;  // rounding of a difference that is no less than 0
}

static void add_information(const Workspace& workspace, const PinholeCamera& camera, float* information) {
  for_each_splat(
      workspace, [](std::size_t) { return Nothing{}; },
      [&](const Splat& splat, VFloat8 sums, Nothing&) HGS_LAMBDA {
        const ExponentSlopes slopes = exponent_slopes(splat, camera);
        float* H = information + N_PARAMETERS * std::size_t{splat.row};
        for (int j = 0; j < 3; ++j) {
          float a[3];
          world_slopes(slopes, camera, j, a);
          H[j] += quadratic(a, sums);
          H[3 + j] += sums[SUM_W2];
        }
        H[6] += slopes.log_radius * slopes.log_radius * sums[SUM_E_DD];
        H[7] += (1.0f - splat.opacity) * (1.0f - splat.opacity) * sums[SUM_E];
      },
      [](std::size_t, Nothing&) {});
}

// Per slot, the form whose value at a pixel is sum_k (dC/dw_k)^2 / (H_k + prior_k): see sweep_quality.
static void quality_coefficients(Workspace& workspace, const PinholeCamera& camera, const float* information,
                                 const float* prior) {
  float* coefficients = workspace.slot_coefficients.require(workspace.n_visible_blocks * BLOCK * 8);
  const Splat* splats = workspace.splats.get();
#pragma omp parallel for schedule(dynamic, 8)
  for (std::size_t block = 0; block < workspace.n_visible_blocks; ++block) {
    for (std::uint32_t rank = 0; rank < workspace.block_splats.get()[block]; ++rank) {
      const std::size_t slot = block * BLOCK + rank;
      const Splat& splat = splats[slot];
      const ExponentSlopes slopes = exponent_slopes(splat, camera);
      const float* H = information + N_PARAMETERS * std::size_t{splat.row};
      float* c = coefficients + 8 * slot;
      for (int k = 0; k < 8; ++k) c[k] = 0.0f;
      for (int j = 0; j < 3; ++j) {
        float a[3];
        world_slopes(slopes, camera, j, a);
        const float share = 1.0f / (H[j] + prior[j]);
        c[SUM_E_XX] += share * a[0] * a[0];
        c[SUM_E_XY] += share * 2.0f * a[0] * a[1];
        c[SUM_E_YY] += share * a[1] * a[1];
        c[SUM_E_XD] += share * 2.0f * a[0] * a[2];
        c[SUM_E_YD] += share * 2.0f * a[1] * a[2];
        c[SUM_E_DD] += share * a[2] * a[2];
        c[SUM_W2] += 1.0f / (H[3 + j] + prior[3 + j]);
      }
      c[SUM_E_DD] += slopes.log_radius * slopes.log_radius / (H[6] + prior[6]);
      c[SUM_E] = (1.0f - splat.opacity) * (1.0f - splat.opacity) / (H[7] + prior[7]);
    }
  }
}

}  // namespace hgs::HGS_VARIANT

// Between the two sweeps of a tile: what its final sums are worth, and their gradients.
// Included only by the variant files (see simd.hpp).
//
// loss = 1/N sum over valid pixels of  w_c |C/A - rgb|_1 / 3 + w_d |D/A - depth|   where A > 0.05
//                                    + w_s (1 - A)^2
// with N the number of valid pixels (0 < depth < inf). N is known before anything is drawn, so loss and backward
// sweep follow each tile's forward sweep while the tile is in cache.
#pragma once
#include "rasterise_sweeps.hpp"

namespace hgs::HGS_VARIANT {

// The part of the image that a tile covers.
struct Window {
  int width, height;
  std::size_t first_pixel;
};

HGS_INLINE Window window_of(const PinholeCamera& camera, int tx, int ty) {
  const int x = tx * TILE_W, y = ty * TILE_H;
  const int width = camera.width - x, height = camera.height - y;
  return {width < TILE_W ? width : TILE_W, height < TILE_H ? height : TILE_H,
          std::size_t{1} * y * camera.width + x};
}

HGS_INLINE bool is_valid_depth(float depth) { return depth > 0.0f && depth < __builtin_inff(); }

struct ValidDepths {
  std::int64_t pixels = 0;
  float farthest = 0.0f;
};

static ValidDepths valid_depths(const Target& target, const PinholeCamera& camera) {
  const std::size_t n = std::size_t{1} * camera.width * camera.height;
  ValidDepths valid;
  for (std::size_t i = 0; i < n; ++i) {
    if (!is_valid_depth(target.depth[i])) continue;
    ++valid.pixels;
    if (target.depth[i] > valid.farthest) valid.farthest = target.depth[i];
  }
  return valid;
}

// Starts a backward sweep: T and S = g . (C, D, A).
HGS_INLINE void start_row(const float (*sums)[TILE_W], float (*planes)[TILE_W], int width) {
  for (int j = 0; j < VECTORS; ++j) {
    const int x = j * LANES;
    const VFloat T = load(sums[T_PLANE] + x);
    VFloat S = load(planes[DR_PLANE] + x) * load(sums[R_PLANE] + x);
    S += load(planes[DG_PLANE] + x) * load(sums[G_PLANE] + x);
    S += load(planes[DB_PLANE] + x) * load(sums[B_PLANE] + x);
    S += load(planes[DD_PLANE] + x) * load(sums[D_PLANE] + x);
    S += load(planes[DA_PLANE] + x) * (1.0f - T);
    store(planes[S_PLANE] + x, S);
  }
  for (int x = 0; x < TILE_W; ++x) planes[GT_PLANE][x] = x < width ? 1.0f : 0.0f;
}

static void clear_row(float (*planes)[TILE_W], int n_planes) {
  for (int plane = 0; plane < n_planes; ++plane) {
    for (int x = 0; x < TILE_W; ++x) planes[plane][x] = 0.0f;
  }
}

static void gradients_of_image(const ForwardTile& state, const Window& window, const PinholeCamera& camera,
                               const ImageGradients& image, GradientTile& gradients) {
  for (int row = 0; row < TILE_H; ++row) {
    float(*planes)[TILE_W] = gradients.rows[row];
    clear_row(planes, GRADIENT_PLANES);
    if (row >= window.height) continue;
    const std::size_t first = window.first_pixel + std::size_t{1} * row * camera.width;
    for (int x = 0; x < window.width; ++x) {
      planes[DR_PLANE][x] = image.colour[3 * (first + x)];
      planes[DG_PLANE][x] = image.colour[3 * (first + x) + 1];
      planes[DB_PLANE][x] = image.colour[3 * (first + x) + 2];
      planes[DD_PLANE][x] = image.depth[first + x];
      planes[DA_PLANE][x] = image.silhouette[first + x];
    }
    start_row(state.rows[row], planes, window.width);
  }
}

struct LossScale {
  float colour, depth, silhouette;  // weight of one pixel's term; colour: of one channel
};

HGS_INLINE LossScale loss_scale(const Target& target, std::int64_t pixels) {
  const float share = 1.0f / static_cast<float>(pixels);
  return {target.colour_weight * share / 3.0f, target.depth_weight * share, target.silhouette_weight * share};
}

HGS_INLINE VFloat vabs(VFloat a) { return (VFloat)((VInt)a & 0x7fffffff); }

// scale * sign(a), 0 at 0.
HGS_INLINE VFloat signed_as(VFloat scale, VFloat a) {
  const VFloat signed_scale = (VFloat)((VInt)scale | ((VInt)a & static_cast<std::int32_t>(0x80000000)));
  return (a != 0.0f) ? signed_scale : VFloat{};
}

// `losses`: |C/A - rgb| (mean of the channels), |D/A - depth| and (1 - A)^2 summed over the tile, and pixels compared.
static void gradients_of_loss(const ForwardTile& state, const Window& window, const PinholeCamera& camera,
                              const Target& target, const LossScale& scale, GradientTile& gradients, double* losses) {
  VFloat colour_loss{}, depth_loss{}, uncovered{}, covered{};
  for (int row = 0; row < TILE_H; ++row) {
    float(*planes)[TILE_W] = gradients.rows[row];
    if (row >= window.height) {
      clear_row(planes, GRADIENT_PLANES);
      continue;
    }
    const float(*sums)[TILE_W] = state.rows[row];
    const std::size_t first = window.first_pixel + std::size_t{1} * row * camera.width;
    const std::uint8_t* rgb = target.rgb + 3 * first;
    alignas(64) float truth[4][TILE_W] = {};  // r, g, b, depth
    for (int x = 0; x < window.width; ++x) {
      truth[0][x] = rgb[3 * x];
      truth[1][x] = rgb[3 * x + 1];
      truth[2][x] = rgb[3 * x + 2];
      truth[3][x] = is_valid_depth(target.depth[first + x]) ? target.depth[first + x] : 0.0f;
    }
    for (int j = 0; j < VECTORS; ++j) {
      const int x = j * LANES;
      const VFloat depth = load(truth[3] + x);
      const VInt valid = depth > 0.0f;
      const VFloat T = load(sums[T_PLANE] + x), A = 1.0f - T;
      const VInt compared = valid & (A > MIN_COVERED);
      const VFloat inverse = compared ? 1.0f / A : VFloat{};
      VFloat slope_by_A{};
      for (int channel = 0; channel < 3; ++channel) {
        const VFloat mean = load(sums[R_PLANE + channel] + x) * inverse;
        const VFloat error = compared ? mean - load(truth[channel] + x) * (1.0f / 255.0f) : VFloat{};
        const VFloat slope = signed_as(scale.colour * inverse, error);
        store(planes[DR_PLANE + channel] + x, slope);
        slope_by_A -= slope * mean;
        colour_loss += vabs(error);
      }
      const VFloat mean = load(sums[D_PLANE] + x) * inverse;
      const VFloat error = compared ? mean - depth : VFloat{};
      const VFloat slope = signed_as(scale.depth * inverse, error);
      store(planes[DD_PLANE] + x, slope);
      slope_by_A -= slope * mean;
      depth_loss += vabs(error);
      store(planes[DA_PLANE] + x, valid ? slope_by_A - 2.0f * scale.silhouette * T : VFloat{});
      uncovered += valid ? T * T : VFloat{};
      covered += compared ? splat_all(1.0f) : VFloat{};
    }
    start_row(sums, planes, window.width);
  }
  for (int k = 0; k < 4; ++k) losses[k] = 0.0;
  for (int lane = 0; lane < LANES; ++lane) {
    losses[0] += colour_loss[lane] / 3.0;
    losses[1] += depth_loss[lane];
    losses[2] += uncovered[lane];
    losses[3] += covered[lane];
  }
}

// Starts a Fisher sweep: everything is still to come.
static void start_fisher(const ForwardTile& state, const Window& window, FisherTile& fisher) {
  for (int row = 0; row < TILE_H; ++row) {
    float(*planes)[TILE_W] = fisher.rows[row];
    clear_row(planes, FISHER_PLANES);
    if (row >= window.height) continue;
    for (int x = 0; x < window.width; ++x) {
      planes[FT_PLANE][x] = 1.0f;
      planes[SR_PLANE][x] = state.rows[row][R_PLANE][x];
      planes[SG_PLANE][x] = state.rows[row][G_PLANE][x];
      planes[SB_PLANE][x] = state.rows[row][B_PLANE][x];
    }
  }
}

}  // namespace hgs::HGS_VARIANT

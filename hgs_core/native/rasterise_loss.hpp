// Between the two sweeps of a tile: what its final sums are worth, and their gradients.
// Included only by the variant files (see simd.hpp).
//
// loss = 1/N sum over valid pixels of  w_c |C/A - rgb|_1 / 3 + w_d |D/A - depth|   where A > 0.05
//                                    + w_s (1 - A)^2
//        + 1/N sum over free pixels of   w_f A^2
// with N the number of valid pixels (0 < depth < inf); free ones (depth = inf) see nothing up to the far plane. N is known before anything is drawn, so loss and backward
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
  const std::int64_t n = std::int64_t{1} * camera.width * camera.height;
  const std::int64_t whole = n / LANES * LANES;
  std::int64_t pixels = 0;
  float farthest = 0.0f;
#pragma omp parallel reduction(+ : pixels) reduction(max : farthest)
  {
    VInt counts{};
    VFloat most{};
#pragma omp for schedule(static)
    for (std::int64_t i = 0; i < whole; i += LANES) {
      const VFloat depth = load(target.depth + i);
      const VInt valid = (depth > 0.0f) & (depth < __builtin_inff());
      counts -= valid;  // a true comparison is -1
      most = vmax(most, valid ? depth : VFloat{});
    }
    for (int lane = 0; lane < LANES; ++lane) {
      pixels += counts[lane];
      farthest = most[lane] > farthest ? most[lane] : farthest;
    }
  }
  for (std::int64_t i = whole; i < n; ++i) {
    if (!is_valid_depth(target.depth[i])) continue;
    ++pixels;
    farthest = target.depth[i] > farthest ? target.depth[i] : farthest;
  }
  return {pixels, farthest};
}

// Starts a backward sweep: T and S = g . (C, D, A).
HGS_INLINE void start_backward(const ForwardTile& state, const Window& window, GradientTile& gradients) {
  for (int patch = 0; patch < PATCHES; ++patch) {
    const float(*sums)[PATCH] = state.patches[patch];
    float(*planes)[PATCH] = gradients.patches[patch];
    for (int i = 0; i < PATCH; i += LANES) {
      const VFloat T = load(sums[T_PLANE] + i);
      VFloat S = load(planes[DR_PLANE] + i) * load(sums[R_PLANE] + i);
      S += load(planes[DG_PLANE] + i) * load(sums[G_PLANE] + i);
      S += load(planes[DB_PLANE] + i) * load(sums[B_PLANE] + i);
      S += load(planes[DD_PLANE] + i) * load(sums[D_PLANE] + i);
      S += load(planes[DA_PLANE] + i) * (1.0f - T);
      store(planes[S_PLANE] + i, S);
    }
  }
  fill_transmittance(gradients, window.width, window.height);
}

static void gradients_of_image(const ForwardTile& state, const Window& window, const PinholeCamera& camera,
                               const ImageGradients& image, GradientTile& gradients) {
  __builtin_memset(&gradients, 0, sizeof(gradients));
  for (int y = 0; y < window.height; ++y) {
    for (int x = 0; x < window.width; ++x) {
      const PixelPlace at = place_of(x, y);
      const std::size_t pixel = window.first_pixel + std::size_t{1} * y * camera.width + x;
      float(*planes)[PATCH] = gradients.patches[at.patch];
      for (int k = 0; k < 3; ++k) planes[DR_PLANE + k][at.lane] = image.colour[3 * pixel + k];
      planes[DD_PLANE][at.lane] = image.depth[pixel];
      planes[DA_PLANE][at.lane] = image.silhouette[pixel];
    }
  }
  start_backward(state, window, gradients);
}

inline constexpr int LOSS_SUMS = 5;

struct LossScale {
  float colour, depth, silhouette, free;  // weight of one pixel's term; colour: of one channel
};

HGS_INLINE LossScale loss_scale(const Target& target, std::int64_t pixels) {
  const float share = 1.0f / static_cast<float>(pixels);
  return {target.colour_weight * share / 3.0f, target.depth_weight * share, target.silhouette_weight * share,
          target.free_weight * share};
}

// scale * sign(a), 0 at 0.
HGS_INLINE VFloat signed_as(VFloat scale, VFloat a) {
  const VFloat signed_scale = (VFloat)((VInt)scale | ((VInt)a & static_cast<std::int32_t>(0x80000000)));
  return (a != 0.0f) ? signed_scale : VFloat{};
}

// What a tile should look like: colours from 0 to 255, and depth, 0 where it is not known, FREE where nothing is.
enum { TRUE_R, TRUE_G, TRUE_B, TRUE_DEPTH, TARGET_PLANES };
using TargetTile = TilePlanes<TARGET_PLANES>;
inline constexpr float FREE = -1.0f;

// The same values of one row of pixels, as many as the tile is wide.
struct TargetRow {
  alignas(64) float values[TARGET_PLANES][TILE_W];
};

HGS_INLINE void load_row(const std::uint8_t* rgb, const float* depth, int width, TargetRow& row) {
  for (int x = 0; x < width; ++x) {
    for (int k = 0; k < 3; ++k) row.values[TRUE_R + k][x] = rgb[3 * x + k];
    row.values[TRUE_DEPTH][x] = depth[x] == __builtin_inff() ? FREE : depth[x] > 0.0f ? depth[x] : 0.0f;
  }
}

HGS_INLINE void load_target(const Target& target, const Window& window, const PinholeCamera& camera,
                            TargetTile& tile) {
  if (window.width < TILE_W || window.height < TILE_H) __builtin_memset(&tile, 0, sizeof(tile));
  TargetRow row{};
  for (int y = 0; y < window.height; ++y) {
    const std::size_t first = window.first_pixel + std::size_t{1} * y * camera.width;
    const std::uint8_t* rgb = target.rgb + 3 * first;
    __builtin_prefetch(rgb + 6 * TILE_W - 1);  // the end of the next tile's row
    __builtin_prefetch(target.depth + first + 2 * TILE_W - 1);
    if (window.width == TILE_W) {
      load_row(rgb, target.depth + first, TILE_W, row);  // a loop of known length becomes vectors
    } else {
      load_row(rgb, target.depth + first, window.width, row);
    }
    for (int x = 0; x < TILE_W; x += EDGE) {
      const PixelPlace at = place_of(x, y);
      for (int k = 0; k < TARGET_PLANES; ++k) {
        __builtin_memcpy(tile.patches[at.patch][k] + at.lane, row.values[k] + x, EDGE * sizeof(float));
      }
    }
  }
}

// `losses`: |C/A - rgb| (mean of the channels), |D/A - depth|, (1 - A)^2, pixels compared, and A^2 where nothing should
// be, each summed over the tile.
static void gradients_of_loss(const ForwardTile& state, const Window& window, const PinholeCamera& camera,
                              const Target& target, const LossScale& scale, GradientTile& gradients, double* losses) {
  TargetTile wanted;
  load_target(target, window, camera, wanted);
  VFloat colour_loss{}, depth_loss{}, uncovered{}, covered{}, in_the_way{};
  for (int patch = 0; patch < PATCHES; ++patch) {
    const float(*truth)[PATCH] = wanted.patches[patch];
    const float(*sums)[PATCH] = state.patches[patch];
    float(*planes)[PATCH] = gradients.patches[patch];
    for (int i = 0; i < PATCH; i += LANES) {
      const VFloat depth = load(truth[TRUE_DEPTH] + i);
      const VInt valid = depth > 0.0f;
      const VFloat T = load(sums[T_PLANE] + i), A = 1.0f - T;
      const VInt compared = valid & (A > MIN_COVERED);
      const VFloat inverse = compared ? 1.0f / A : VFloat{};
      VFloat slope_by_A{};
      for (int channel = 0; channel < 3; ++channel) {
        const VFloat mean = load(sums[R_PLANE + channel] + i) * inverse;
        const VFloat error = compared ? mean - load(truth[TRUE_R + channel] + i) * (1.0f / 255.0f) : VFloat{};
        const VFloat slope = signed_as(scale.colour * inverse, error);
        store(planes[DR_PLANE + channel] + i, slope);
        slope_by_A -= slope * mean;
        colour_loss += vabs(error);
      }
      const VFloat mean = load(sums[D_PLANE] + i) * inverse;
      const VFloat error = compared ? mean - depth : VFloat{};
      const VFloat slope = signed_as(scale.depth * inverse, error);
      store(planes[DD_PLANE] + i, slope);
      slope_by_A -= slope * mean;
      depth_loss += vabs(error);
      const VInt free = depth == FREE;
      const VFloat slope_if_free = free ? 2.0f * scale.free * A : VFloat{};
      store(planes[DA_PLANE] + i, valid ? slope_by_A - 2.0f * scale.silhouette * T : slope_if_free);
      in_the_way += free ? A * A : VFloat{};
      uncovered += valid ? T * T : VFloat{};
      covered += compared ? splat_all(1.0f) : VFloat{};
    }
  }
  start_backward(state, window, gradients);
  for (int k = 0; k < LOSS_SUMS; ++k) losses[k] = 0.0;
  for (int lane = 0; lane < LANES; ++lane) {
    losses[0] += colour_loss[lane] / 3.0;
    losses[1] += depth_loss[lane];
    losses[2] += uncovered[lane];
    losses[3] += covered[lane];
    losses[4] += in_the_way[lane];
  }
}

}  // namespace hgs::HGS_VARIANT

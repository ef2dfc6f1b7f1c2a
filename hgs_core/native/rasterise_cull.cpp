// Frustum test of whole blocks of Gaussians.
//
// A block's bounds contain centre -+ radius of each of its rows, so no radius in it is more than half its shortest
// edge. A splat reaches at most sqrt(2 ln 255) < 3.34 standard deviations; with sigma^2 = (f r / z)^2 + 0.3 that is
// at most 3.34 (f r / z + 0.55) pixels: bounds grown by 3.34 radii against an image grown by 1.84 pixels. Discs reach
// farther off the axis, as flat images stretch things there: sqrt(1 + tan^2) times as far.
#include <cmath>

#include "rasterise_workspace.hpp"

namespace hgs {

namespace {

// Whether all of a box lies behind what the limits show. `reach`: of its splats, in pixels times their depth.
bool is_hidden(const float centre[3], const float half[3], float nearest_m, const PinholeCamera& camera, float reach,
               float margin_px, const TileLimits& limits) {
  if (nearest_m < NEAR_M) return false;  // it surrounds the camera, or nearly
  float left = INFINITY, top = INFINITY, right = -INFINITY, bottom = -INFINITY;
  for (int corner = 0; corner < 8; ++corner) {
    float p[3];
    for (int i = 0; i < 3; ++i) {
      p[i] = camera.translation[i];
      for (int j = 0; j < 3; ++j) {
        p[i] += camera.rotation[3 * i + j] * (centre[j] + ((corner >> j & 1) != 0 ? half[j] : -half[j]));
      }
    }
    const float u = camera.fx * p[0] / p[2] + camera.cx, v = camera.fy * p[1] / p[2] + camera.cy;
    left = std::fmin(left, u), right = std::fmax(right, u);
    top = std::fmin(top, v), bottom = std::fmax(bottom, v);
  }
  const float around_px = margin_px + reach / nearest_m;
  return limits.hide(left - around_px, top - around_px, right + around_px, bottom + around_px, nearest_m);
}

}  // namespace

void cull_blocks(const GaussianRows& gaussians, const PinholeCamera& camera, const TileLimits* limits,
                 Workspace& workspace) {
  const Tangents widest = widest_tangents(camera);
  const float stretch = gaussians.normals == nullptr
                            ? 1.0f
                            : std::sqrt(1.0f + std::fmax(widest.x * widest.x, widest.y * widest.y));
  constexpr float DEVIATIONS = 3.34f;
  const std::size_t n_blocks = (gaussians.n + BLOCK - 1) / BLOCK;
  std::uint32_t* visible = workspace.visible_blocks.require(n_blocks);
  const float margin_px = DEVIATIONS * std::sqrt(camera.low_pass_px2) + 0.01f;
  const float f = gaussians.normals == nullptr ? std::sqrt(camera.fx * camera.fy) : std::fmax(camera.fx, camera.fy);

  // Half-spaces n . p + offset z-wise: p is inside when n . p >= 0; all but the near plane pass through the camera.
  const float planes[4][3] = {
      {camera.fx, 0.0f, camera.cx + margin_px},
      {-camera.fx, 0.0f, camera.width - camera.cx + margin_px},
      {0.0f, camera.fy, camera.cy + margin_px},
      {0.0f, -camera.fy, camera.height - camera.cy + margin_px},
  };
  float normals[4][3];  // in the world frame
  float offsets[4];
  for (int k = 0; k < 4; ++k) {
    for (int j = 0; j < 3; ++j) {
      normals[k][j] = 0.0f;
      for (int i = 0; i < 3; ++i) normals[k][j] += planes[k][i] * camera.rotation[3 * i + j];
    }
    offsets[k] = 0.0f;
    for (int i = 0; i < 3; ++i) offsets[k] += planes[k][i] * camera.translation[i];
  }
  const float* forward = camera.rotation + 6;

  std::size_t n_visible = 0;
  for (std::size_t block = 0; block < n_blocks; ++block) {
    const float* bounds = gaussians.block_bounds + 6 * block;
    float centre[3], half[3];
    float shortest = INFINITY;
    for (int j = 0; j < 3; ++j) {
      centre[j] = 0.5f * (bounds[j] + bounds[3 + j]);
      half[j] = 0.5f * (bounds[3 + j] - bounds[j]);
      shortest = std::fmin(shortest, half[j]);
    }
    float depth = camera.translation[2], depth_extent = 0.0f;
    for (int j = 0; j < 3; ++j) {
      depth += forward[j] * centre[j];
      depth_extent += std::fabs(forward[j]) * half[j];
    }
    bool inside = depth + depth_extent > NEAR_M - 1e-4f && depth - depth_extent < camera.far_m + 1e-4f;
    // A splat's reach f r / z in pixels is r along x or y in the camera, times f in units of n . p.
    const float reach = DEVIATIONS * stretch * shortest * f;
    for (int k = 0; inside && k < 4; ++k) {
      float distance = offsets[k], extent = 0.0f;
      for (int j = 0; j < 3; ++j) {
        distance += normals[k][j] * centre[j];
        extent += std::fabs(normals[k][j]) * half[j];
      }
      inside = distance + extent + reach + 1e-3f >= 0.0f;
    }
    if (inside && limits != nullptr) {
      inside = !is_hidden(centre, half, depth - depth_extent - 1e-4f, camera, reach, margin_px, *limits);
    }
    if (inside) visible[n_visible++] = static_cast<std::uint32_t>(block);
  }
  workspace.n_visible_blocks = n_visible;
}

}  // namespace hgs

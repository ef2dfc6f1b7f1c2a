#include "shading.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hgs {
namespace {

constexpr std::uint32_t kNoTriangle = 0xFFFFFFFFu;

struct Rgb {
  float r, g, b;
};

// Bilinear look-up in one level; texture coordinates repeat.
Rgb bilinear(const Appearance& a, std::int32_t level, float u, float v) {
  const std::int32_t width = a.level_width[level], height = a.level_height[level];
  const float x = u * static_cast<float>(width) - 0.5f;
  const float y = (1.0f - v) * static_cast<float>(height) - 0.5f;
  const float fx = std::floor(x), fy = std::floor(y);
  const float wx = x - fx, wy = y - fy;
  // u, v are in [0, 1], so one step over an edge is the most that can happen.
  std::int32_t x0 = static_cast<std::int32_t>(fx), y0 = static_cast<std::int32_t>(fy);
  x0 = x0 < 0 ? width - 1 : std::min(x0, width - 1);
  y0 = y0 < 0 ? height - 1 : std::min(y0, height - 1);
  const std::int32_t x1 = x0 + 1 == width ? 0 : x0 + 1;
  const std::int32_t y1 = y0 + 1 == height ? 0 : y0 + 1;
  const std::uint8_t* base = a.texels + 3 * a.level_offset[level];
  const std::uint8_t* top = base + 3 * static_cast<std::ptrdiff_t>(y0) * width;
  const std::uint8_t* bottom = base + 3 * static_cast<std::ptrdiff_t>(y1) * width;
  const float w00 = (1 - wx) * (1 - wy), w10 = wx * (1 - wy), w01 = (1 - wx) * wy, w11 = wx * wy;
  const std::uint8_t *p00 = top + 3 * x0, *p10 = top + 3 * x1, *p01 = bottom + 3 * x0, *p11 = bottom + 3 * x1;
  return {w00 * p00[0] + w10 * p10[0] + w01 * p01[0] + w11 * p11[0],
          w00 * p00[1] + w10 * p10[1] + w01 * p01[1] + w11 * p11[1],
          w00 * p00[2] + w10 * p10[2] + w01 * p01[2] + w11 * p11[2]};
}

std::uint8_t to_byte(float value) {
  return static_cast<std::uint8_t>(value > 0.0f ? std::min(value + 0.5f, 255.0f) : 0.0f);  // 0 for NaN
}

}  // namespace

// The pixel of a camera with focal length f covers t^2 / (f^2 |n.d|) of a surface with normal n that its
// ray o + t d (d scaled to z = 1) meets: the solid angle 1 / (f^2 |d|^3), times the squared distance
// (t |d|)^2, over the cosine |n.d| / |d|. With q texels per metre its side spans s = q t / (f sqrt|n.d|)
// texels, so the texture is read at level log2(s), linearly between the two levels around it.
void shade(const Appearance& a, const Hits& hits, float focal_px, float range_m,
           const std::uint8_t background[3], std::uint8_t* rgb, float* depth_m, int threads) {
  const auto n = static_cast<std::ptrdiff_t>(hits.n_rays);
  const float infinity = std::numeric_limits<float>::infinity();
#pragma omp parallel for schedule(static) num_threads(threads)
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    const std::uint32_t triangle = hits.triangle[i];
    if (triangle == kNoTriangle || triangle >= a.n_triangles) {
      for (int k = 0; k < 3; ++k) rgb[3 * i + k] = background[k];
      depth_m[i] = infinity;
      continue;
    }
    const float t = hits.z_depth_m[i];
    depth_m[i] = t <= range_m ? t : infinity;

    const float b1 = hits.barycentric[2 * i], b2 = hits.barycentric[2 * i + 1], b0 = 1.0f - b1 - b2;
    const float* tint = a.tint + 3 * static_cast<std::size_t>(triangle);
    Rgb colour{255.0f, 255.0f, 255.0f};
    const std::int32_t texture = a.texture[triangle];
    if (texture >= 0) {
      const float* uv = a.uv + 6 * static_cast<std::size_t>(triangle);
      float u = b0 * uv[0] + b1 * uv[2] + b2 * uv[4];
      float v = b0 * uv[1] + b1 * uv[3] + b2 * uv[5];
      u -= std::floor(u);
      v -= std::floor(v);
      // Triangles of no area have no coordinates.
      if (!(u >= 0.0f && u <= 1.0f && v >= 0.0f && v <= 1.0f)) u = v = 0.0f;
      const float span = a.texels_per_metre[triangle] * t / (focal_px * std::sqrt(std::max(hits.facing[i], 1e-3f)));
      const float top = static_cast<float>(a.level_count[texture] - 1);
      const float level = std::clamp(std::log2(std::max(1e-6f, span)), 0.0f, top);  // NaN counts as the least span
      const auto lower = static_cast<std::int32_t>(level);
      const float between = level - static_cast<float>(lower);
      const std::int32_t first = a.level_first[texture];
      colour = bilinear(a, first + lower, u, v);
      if (between > 0.0f) {
        const Rgb coarse = bilinear(a, first + lower + 1, u, v);
        colour.r += between * (coarse.r - colour.r);
        colour.g += between * (coarse.g - colour.g);
        colour.b += between * (coarse.b - colour.b);
      }
    }
    if (a.corner_rgb != nullptr) {
      const std::uint8_t* c = a.corner_rgb + 9 * static_cast<std::size_t>(triangle);
      constexpr float scale = 1.0f / 255.0f;
      colour.r *= scale * (b0 * c[0] + b1 * c[3] + b2 * c[6]);
      colour.g *= scale * (b0 * c[1] + b1 * c[4] + b2 * c[7]);
      colour.b *= scale * (b0 * c[2] + b1 * c[5] + b2 * c[8]);
    }
    rgb[3 * i + 0] = to_byte(colour.r * tint[0]);
    rgb[3 * i + 1] = to_byte(colour.g * tint[1]);
    rgb[3 * i + 2] = to_byte(colour.b * tint[2]);
  }
}

}  // namespace hgs

// Colours of surface points seen along rays: texture x fixed light, the same from every side and distance.
#pragma once
#include <cstddef>
#include <cstdint>

namespace hgs {

// What a triangle looks like. Texels are RGB bytes; level l of a texture starts at texel
// `level_offset[level_first[texture] + l]` and measures `level_width` x `level_height`.
struct Appearance {
  std::size_t n_triangles;
  const float* uv;                 // n_triangles x 3 x 2, (0, 0) = lower left
  const float* tint;               // n_triangles x 3: light x material factor
  const float* texels_per_metre;   // n_triangles, of level 0
  const std::int32_t* texture;     // n_triangles, -1 = none
  const std::uint8_t* corner_rgb;  // n_triangles x 3 x 3, or null
  const std::uint8_t* texels;
  const std::int64_t* level_offset;
  const std::int32_t* level_width;
  const std::int32_t* level_height;
  const std::int32_t* level_first;  // n_textures
  const std::int32_t* level_count;  // n_textures
};

struct Hits {
  std::size_t n_rays;
  const std::uint32_t* triangle;  // 0xFFFFFFFF = none
  const float* barycentric;       // n_rays x 2, weights of corners 1 and 2
  const float* z_depth_m;         // n_rays, along rays scaled to z = 1 in the camera
  const float* facing;            // n_rays, |n.d| of the unit normal and such a ray's direction
};

void shade(const Appearance& appearance, const Hits& hits, float focal_px, float range_m,
           const std::uint8_t background[3], std::uint8_t* rgb, float* depth_m, int threads);

}  // namespace hgs

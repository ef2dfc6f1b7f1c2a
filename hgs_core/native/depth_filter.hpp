// Depth images: halving and edge-aware smoothing.
#pragma once
#include <cstdint>

namespace hgs {

// Halves an RGB-D image. Colour: 2 x 2 mean. Depth: mean over the surface that most of the four pixels show (depths
// within `edge_m` of one of them); +inf where more say "nothing within range", 0 where there is no return at all.
void halve_frame(const std::uint8_t* rgb, const float* depth, int width, int height, float edge_m,
                 std::uint8_t* rgb_half, float* depth_half);

// Edge-aware mean of inverse depth over a (2 radius + 1)^2 window.
// Inverse depth is linear across a plane, so a pair of pixels opposite each other has the centre's inverse
// depth as its mean on any plane, however slanted. A pair is averaged in only when its mean agrees with the
// centre within `gate_m` (converted to inverse depth there): edges and corners keep their shape.
void smooth_depth(const float* depth, int width, int height, int radius, float gate_m, float* smoothed);

}  // namespace hgs

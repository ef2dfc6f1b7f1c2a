// Normals of the surfaces that a depth image shows.
#pragma once
#include <cstdint>

namespace hgs {

struct DepthView {
  const float* depth;  // (height, width), z; 0 and +inf: not measured
  int width, height;
  double fx, fy, cx, cy;
};

// Unit normals (n, 3) at pixels that are measured, in the camera's frame, towards it; without a plane around a pixel,
// the way to the camera. On a plane inverse depth is linear in the image: it is fitted to those of the 7 x 7 pixels
// around that agree with it, at first with the smaller one-sided differences, so that at the border of a surface they
// are that surface's own.
void surface_normals(const DepthView& view, const std::int64_t* rows, const std::int64_t* columns, std::int64_t n,
                     double* normals);

}  // namespace hgs

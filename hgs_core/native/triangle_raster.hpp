// Which triangle of a mesh each pixel of a pinhole camera shows first: a z-buffer instead of a ray a pixel.
#pragma once
#include <cstddef>
#include <cstdint>

namespace hgs {

struct MeshTriangles {
  const float* vertices;  // n_vertices x 3, world [m]
  std::int64_t n_vertices;
  const std::int32_t* triangles;  // n_triangles x 3
  std::int64_t n_triangles;
};

// Pixel (row, column) looks along ((column + 0.5 + du - cx) / fx, (row + 0.5 + dv - cy) / fy, 1).
struct LookingCamera {
  int width, height;
  double fx, fy, cx, cy;
  const double* rotation;     // 3 x 3, row by row: axes of the camera in the world
  const double* translation;  // 3
};

// One look a pixel of those wanted: offsets (n_looks, 2) in pixels, at most one either way.
struct Looks {
  const float* offsets;
  int n_looks;
  const std::uint8_t* wanted;  // height x width, or null: all
  std::int64_t n_wanted;
};

// What looks meet (n_looks, n_wanted), pixels row by row; 0xFFFFFFFF where they leave the world.
struct FirstSurfaces {
  std::uint32_t* triangle;
  float* barycentric;  // x 2, weights of corners 1 and 2
  float* z_depth;      // [m], +inf where they leave the world
  float* facing;       // |n . d| of the unit normal and the look's direction, which has z = 1
};

// Of triangles at the same depth the first one is met. Results do not depend on the number of threads.
void first_surfaces(const MeshTriangles& mesh, const LookingCamera& camera, const Looks& looks,
                    const FirstSurfaces& found);

// A triangle as three half-spaces of directions d, and the inverse depth at which d meets its plane: each a dot product
// with d (Olano and Greer, Triangle Scan Conversion Using 2D Homogeneous Coordinates, 1997). A triangle that reaches
// behind the camera needs no clipping so.
struct DirectionTriangle {
  float inside[3][3];  // >= 0; the weight of the corner opposite to the edge, up to a common factor
  float inverse_depth[3];
  float plane_distance;  // of the camera [m]
  std::int32_t number;
  std::int32_t first_row, last_row, first_column, last_column;  // may show it; the last one is included
};

// Rows of one picture that are filled together: their z-buffer fits into a cache.
struct RasterRows {
  int stride;                  // the width, up to a multiple of any vector
  int first, last;             // rows [first, last)
  const float* columns;        // x of the directions (stride)
  const float* rows;           // y of the directions, of the whole picture
  const std::uint8_t* wanted;  // of the whole picture (height, stride), or null
  const DirectionTriangle* triangles;
  const std::int32_t* chosen;  // those that may lie in these rows, in rising order
  std::int64_t n_chosen;
};

// Fills `inverse_depth` and `nearest` (rows, stride): which of `triangles` has the greatest inverse depth, -1 for none.
using FillRows = void (*)(const RasterRows& rows, float* inverse_depth, std::int32_t* nearest);

}  // namespace hgs

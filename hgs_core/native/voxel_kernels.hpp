// The voxel map's kernels: plain arrays over a dense box of voxels, C order, coordinates in cells.
#pragma once
#include <cstdint>

#include "voxel_traversal.hpp"

namespace hgs {

enum : std::uint8_t { kUnobserved = 0, kFree = 1, kOccupied = 2 };

struct LogOdds {
  float hit, miss, lowest, highest;
};

// A pinhole camera looking at the grid: p_cells = rotation * p_camera + position, with p_camera in cells, too.
struct GridCamera {
  std::array<double, 9> rotation;  // row-major, world from camera
  Point position;
  double fx, fy, cx, cy;
  std::int64_t width, height;
};

void integrate_rays(const Grid& grid, std::uint8_t* states, float* log_odds, const Point& origin, const double* ends,
                    const std::uint8_t* is_hit, std::int64_t n_rays, const LogOdds& model);

std::int64_t count_attempts(const Grid& grid, const std::uint8_t* states, std::uint8_t* attempts,
                            const GridCamera& camera, const float* depth_m, double range_m, double cell_m,
                            double border_px);

void missing_voxels(const Grid& grid, const std::uint8_t* states, const std::uint8_t* attempts,
                    std::uint8_t max_attempts, std::int64_t min_cluster, bool* missing);

// How many voxels of each column of the box [low, high) hold 0, 1 and 2: counts (nx, ny, 3).
void count_in_columns(const Grid& grid, const std::uint8_t* values, const Cell& low, const Cell& high,
                      std::int32_t* counts);

}  // namespace hgs

// The voxel map's kernels: plain arrays over a dense box of voxels, C order, coordinates in cells.
#pragma once
#include <array>
#include <atomic>
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

// Which chunks of columns a call changed: flags of chunks of 2^kChunkShift x 2^kChunkShift columns, row-major.
inline constexpr int kChunkShift = 4;

struct ChangedChunks {
  std::uint8_t* flags;
  std::int64_t n_y;

  // Threads may mark the same chunk.
  void mark(std::int64_t i, std::int64_t j) const {
    std::atomic_ref<std::uint8_t>(flags[(i >> kChunkShift) * n_y + (j >> kChunkShift)])
        .store(1, std::memory_order_relaxed);
  }
};

// Returns how many voxels were observed for the first time; marks where states changed. Rays whose ends are no numbers
// are left out.
std::int64_t integrate_rays(const Grid& grid, std::uint8_t* states, float* log_odds, const Point& origin,
                            const double* ends, const std::uint8_t* is_hit, std::int64_t n_rays, const LogOdds& model,
                            const ChangedChunks& changed);

// Returns how many attempts it counted; marks where.
std::int64_t count_attempts(const Grid& grid, const std::uint8_t* states, std::uint8_t* attempts,
                            const GridCamera& camera, const float* depth_m, double range_m, double cell_m,
                            double border_px, const ChangedChunks& changed);

// Columns [low, high).
struct ColumnBox {
  std::array<std::int64_t, 2> low, high;
};

// Renews `missing` and its sums over columns (nx, ny) where they may have changed when states and attempts changed
// in the columns of `box` only. Returns by how much the number of missing voxels grew.
std::int64_t renew_missing(const Grid& grid, const std::uint8_t* states, const std::uint8_t* attempts,
                           std::uint8_t max_attempts, std::int64_t min_cluster, const ColumnBox& box, bool* missing,
                           std::int32_t* in_columns);

// How many voxels of each column of the box [low, high) hold 0, 1 and 2: counts (nx, ny, 3).
void count_in_columns(const Grid& grid, const std::uint8_t* values, const Cell& low, const Cell& high,
                      std::int32_t* counts);

}  // namespace hgs

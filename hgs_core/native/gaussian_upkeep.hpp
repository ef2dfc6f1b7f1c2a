// Upkeep of a map's rows: the bounds of its blocks, and which Gaussians are worth keeping.
#pragma once
#include <cstdint>

#include "voxel_kernels.hpp"

namespace hgs {

// The bounds of each block of `block` rows (n_blocks, 6): lower and upper corner of its centres, widened by its largest
// radius.
void bound_blocks(const float* parameters, std::int64_t n, std::int64_t block, float* bounds);

// Moves the flagged ones of n rows of `row_bytes` together to the front, in their order.
void compact_rows(std::uint8_t* rows, std::int64_t n, std::int64_t row_bytes, const bool* kept);

// Where voxels lie: voxel (0, 0, 0) of the arrays has the global index `origin`, edges are `size_m` long.
struct VoxelPlace {
  Cell origin;
  double size_m;
};

// Flags those of n Gaussians (n, 8) whose logit of the opacity is at least `min_logit_opacity` and that do not float:
// a Gaussian floats when its voxel is free and none of the 26 around that is occupied.
void flag_worth_keeping(const float* parameters, std::int64_t n, float min_logit_opacity, const Grid& grid,
                        const std::uint8_t* states, const VoxelPlace& place, bool* kept);

// Counts those of n Gaussians (n, 8) whose logit of the opacity is at least `min_logit_opacity` by voxel; those beyond
// the grid are left out.
void count_by_voxel(const float* parameters, std::int64_t n, float min_logit_opacity, const Grid& grid,
                    const VoxelPlace& place, std::int32_t* counts);

}  // namespace hgs

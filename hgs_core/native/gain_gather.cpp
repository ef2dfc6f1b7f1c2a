// Gaussians gathered into the voxels that hold their centres.
//
//   optical depth of a voxel   tau = sum_i o_i 2 pi r_i^2 / face area
//     (the integral of o exp(-d^2 / 2 r^2) over a plane is 2 pi o r^2: tau is the mean over a face of what
//      one crossing of the voxel meets; a disc counts as if it were looked at along its normal)
//
// Only wanted chunks of columns are filled. The per-Gaussian part runs in parallel over blocks of rows and leaves a
// list of what each adds to which voxel; then each thread sums its own range of voxels in the order of the rows, so
// that the sums do not depend on the number of threads.
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "gain_kernels.hpp"
#include "scratch.hpp"
#include "variants.hpp"
#include "voxel_kernels.hpp"

namespace hgs {

namespace {

struct GatheredBlock {
  std::int64_t first_row;
  int n_entries;
  std::int32_t lowest_voxel, highest_voxel;
};

// Calls visit(first, n) for each run of voxels of a chunk.
template <class Visit>
void for_runs_of(const Grid& grid, std::int64_t chunk_i, std::int64_t chunk_j, Visit&& visit) {
  const std::int64_t end_i = std::min((chunk_i + 1) * CHUNK, grid.shape[0]);
  const std::int64_t first_j = chunk_j * CHUNK, end_j = std::min((chunk_j + 1) * CHUNK, grid.shape[1]);
  for (std::int64_t i = chunk_i * CHUNK; i < end_i; ++i) {
    visit(grid.offset({i, first_j, 0}), (end_j - first_j) * grid.shape[2]);
  }
}

// What the sums and the states of the voxels make of a chunk's cells. While summing, `unseen` holds the count.
void finish_chunk(const Grid& grid, const GainField& field, const VoxelStates& voxels, std::int64_t chunk) {
  std::int64_t n_gaussians = 0, n_populated = 0;
  for_runs_of(grid, chunk / field.chunks.shape[1], chunk % field.chunks.shape[1], [&](std::int64_t first, std::int64_t n) {
    for (std::int64_t v = first; v < first + n; ++v) {
      PanoramaCell& cell = field.cells[v];
      n_gaussians += static_cast<std::int64_t>(cell.unseen);
      n_populated += cell.unseen > 0.0f;
      const bool unobserved = voxels.states[v] == kUnobserved;
      const bool dismissed = unobserved && voxels.attempts[v] >= voxels.max_attempts;
      cell.unseen = unobserved && !dismissed ? 1.0f : 0.0f;
      if (dismissed || voxels.states[v] == kOccupied) cell.optical_depth = std::numeric_limits<float>::infinity();
    }
  });
  field.n_gaussians[chunk] = n_gaussians;
  field.n_populated[chunk] = n_populated;
}

}  // namespace

std::vector<std::int64_t> blocks_in(const GaussianRows& map, const GridPlace& place, const WantedChunks& chunks) {
  std::vector<std::int64_t> first_rows;
  const auto n = static_cast<std::int64_t>(map.n);
  for (std::int64_t first = 0; first < n; first += BLOCK) {
    const float* box = map.block_bounds + 6 * (first / BLOCK);
    std::int64_t low[2], high[2];
    for (int a = 0; a < 2; ++a) {
      const auto chunk = [&](float x) {
        const double cells = std::floor((x - place.lower[a]) / place.cell);
        return static_cast<std::int64_t>(std::floor(std::clamp(cells, -1e9, 1e9) / CHUNK));
      };
      low[a] = std::max<std::int64_t>(chunk(box[a]), 0);
      high[a] = std::min(chunk(box[3 + a]) + 1, chunks.shape[a]);
    }
    const bool any = [&] {
      for (std::int64_t i = low[0]; i < high[0]; ++i) {
        for (std::int64_t j = low[1]; j < high[1]; ++j) {
          if (chunks.wanted[i * chunks.shape[1] + j] != 0) return true;
        }
      }
      return false;
    }();
    if (any) first_rows.push_back(first);
  }
  return first_rows;
}

void gather_gain(const Grid& grid, const GridPlace& place, const GaussianRows& map, const VoxelStates& voxels,
                 float min_opacity, const GainField& field) {
  std::vector<std::int64_t> chunks;
  std::int64_t first_column = grid.shape[0], last_column = 0;  // of the wanted ones
  for (std::int64_t c = 0; c < field.chunks.shape[0] * field.chunks.shape[1]; ++c) {
    if (field.chunks.wanted[c] == 0) continue;
    chunks.push_back(c);
    first_column = std::min(first_column, c / field.chunks.shape[1] * CHUNK);
    last_column = std::max(last_column, std::min((c / field.chunks.shape[1] + 1) * CHUNK, grid.shape[0]));
  }
  if (chunks.empty()) return;
  std::vector<GatheredBlock> blocks;
  for (const std::int64_t first : blocks_in(map, place, field.chunks)) blocks.push_back({first, 0, 0, 0});
  const GatherBox box{{static_cast<float>(place.lower[0]), static_cast<float>(place.lower[1]),
                       static_cast<float>(place.lower[2])},
                      static_cast<float>(place.cell),
                      {static_cast<std::int32_t>(grid.shape[0]), static_cast<std::int32_t>(grid.shape[1]),
                       static_cast<std::int32_t>(grid.shape[2])},
                      static_cast<std::int32_t>(field.chunks.shape[1]),
                      field.chunks.wanted};
  static thread_local Scratch<GatherEntry> scratch;  // its pages cost more than the work done in them
  GatherEntry* entries = scratch.require(blocks.size() * BLOCK);
  const auto n_blocks = static_cast<std::int64_t>(blocks.size());
  const auto n_chunks = static_cast<std::int64_t>(chunks.size());
  const std::int64_t plane = grid.shape[1] * grid.shape[2];

#pragma omp parallel
  {
#pragma omp for schedule(dynamic, 1)
    for (std::int64_t c = 0; c < n_chunks; ++c) {
      for_runs_of(grid, chunks[c] / field.chunks.shape[1], chunks[c] % field.chunks.shape[1],
                  [&](std::int64_t first, std::int64_t n) { std::fill_n(field.cells + first, n, PanoramaCell{}); });
    }
#pragma omp for schedule(dynamic, 16)
    for (std::int64_t b = 0; b < n_blocks; ++b) {
      GatheredBlock& block = blocks[b];
      GatherEntry* own = entries + b * BLOCK;
      const auto n_rows = static_cast<int>(std::min<std::int64_t>(BLOCK, static_cast<std::int64_t>(map.n) - block.first_row));
      block.n_entries = variant_kernels().gain.gather(map.parameters + N_PARAMETERS * block.first_row, n_rows, box,
                                                      min_opacity, own);
      block.lowest_voxel = std::numeric_limits<std::int32_t>::max();
      block.highest_voxel = -1;
      for (int e = 0; e < block.n_entries; ++e) {
        block.lowest_voxel = std::min(block.lowest_voxel, own[e].voxel);
        block.highest_voxel = std::max(block.highest_voxel, own[e].voxel);
      }
    }
    const std::int64_t columns = last_column - first_column, thread = omp_get_thread_num(), n = omp_get_num_threads();
    const std::int64_t low = (first_column + columns * thread / n) * plane;
    const std::int64_t high = (first_column + columns * (thread + 1) / n) * plane;
    for (std::int64_t b = 0; b < n_blocks; ++b) {
      if (blocks[b].highest_voxel < low || blocks[b].lowest_voxel >= high) continue;
      const GatherEntry* own = entries + b * BLOCK;
      for (int e = 0; e < blocks[b].n_entries; ++e) {
        if (own[e].voxel < low || own[e].voxel >= high) continue;
        PanoramaCell& cell = field.cells[own[e].voxel];
        cell.optical_depth += own[e].optical_depth;
        cell.unseen += 1.0f;
      }
    }
#pragma omp barrier
#pragma omp for schedule(dynamic, 1)
    for (std::int64_t c = 0; c < n_chunks; ++c) finish_chunk(grid, field, voxels, chunks[c]);
  }
}

}  // namespace hgs

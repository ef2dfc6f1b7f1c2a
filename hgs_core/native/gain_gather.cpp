// Gaussians gathered into the voxels that hold their centres.
//
//   optical depth of a voxel   tau = sum_i o_i 2 pi r_i^2 / face area
//     (the integral of o exp(-d^2 / 2 r^2) over a plane is 2 pi o r^2: tau is the mean over a face of what
//      one crossing of the voxel meets)
//
//   quality of a voxel         Q = sum_i q_i,   q_i = (c_i / I_i,colour) sum_k I_ik / (I_ik + prior)
//     I_ik is H_train. One more view is expected to hold information in proportion to what the training views hold,
//     H_cand,ik = I_ik c_i / (I_i,colour d^2), so q_i / d^2 is the gain of Eq. 9 in its trace form. c_i is the
//     colour information expected from 1 m: colour information is sum (alpha T)^2 over pixels, which for a
//     Gaussian of opacity o and screen radius f r / d that nothing covers is pi o^2 (f r / d)^2. Its neighbours on the
//     surface always cover it partly; the share that is left, s, is measured on the training views of Gaussians
//     from everywhere in the map:
//       c_i = s pi o_i^2 (f r_i)^2,   s = sum_i I_i,colour / sum_i w_i pi o_i^2 (f r_i)^2,   w_i = sum 1 / z^2
//     So a Gaussian that its training views saw at a grazing angle, or half hidden, is worth a view although they
//     were near: each single view counts for what it held, not for its distance.
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

constexpr std::int64_t SAMPLED_BLOCKS = 1024;  // enough for the uncovered share of a map of any size

struct GatheredBlock {
  std::int64_t first_row;
  int n_entries;
  std::int32_t lowest_voxel, highest_voxel;
};

InformedRows rows_from(const InformedMap& map, std::int64_t first) {
  return {map.parameters + 8 * first, map.information + 8 * first, map.weight + first,
          static_cast<int>(std::min<std::int64_t>(BLOCK, map.n - first))};
}

// The chunks [low, high) that columns of [lower, upper] m lie in; empty when they lie outside.
struct ChunkRange {
  std::int64_t low[2], high[2];
};

ChunkRange chunks_of(const float* lower, const float* upper, const GridPlace& place, const GainField& field) {
  ChunkRange range;
  for (int a = 0; a < 2; ++a) {
    const auto chunk = [&](float x) {
      const double cells = std::floor((x - place.lower[a]) / place.cell);
      return static_cast<std::int64_t>(std::floor(std::clamp(cells, -1e9, 1e9) / CHUNK));
    };
    range.low[a] = std::max<std::int64_t>(chunk(lower[a]), 0);
    range.high[a] = std::min(chunk(upper[a]) + 1, field.chunks[a]);
  }
  return range;
}

bool any_wanted(const ChunkRange& range, const GainField& field) {
  for (std::int64_t i = range.low[0]; i < range.high[0]; ++i) {
    for (std::int64_t j = range.low[1]; j < range.high[1]; ++j) {
      if (field.wanted[i * field.chunks[1] + j] != 0) return true;
    }
  }
  return false;
}

// Calls visit(first, n) for each run of voxels of a chunk.
template <class Visit>
void for_runs_of(const Grid& grid, std::int64_t chunk_i, std::int64_t chunk_j, Visit&& visit) {
  const std::int64_t end_i = std::min((chunk_i + 1) * CHUNK, grid.shape[0]);
  const std::int64_t first_j = chunk_j * CHUNK, end_j = std::min((chunk_j + 1) * CHUNK, grid.shape[1]);
  for (std::int64_t i = chunk_i * CHUNK; i < end_i; ++i) {
    visit(grid.offset({i, first_j, 0}), (end_j - first_j) * grid.shape[2]);
  }
}

double uncovered_share(const InformedMap& map, const GatherRule& rule) {
  const std::int64_t n_blocks = (map.n + BLOCK - 1) / BLOCK;
  const std::int64_t stride = std::max<std::int64_t>(1, (n_blocks + SAMPLED_BLOCKS - 1) / SAMPLED_BLOCKS);
  const std::int64_t n_sampled = (n_blocks + stride - 1) / stride;
  std::vector<InformationSums> sums(static_cast<std::size_t>(n_sampled));
#pragma omp parallel for schedule(static)
  for (std::int64_t b = 0; b < n_sampled; ++b) {
    sums[b] = variant_kernels().gain.information_sums(rows_from(map, b * stride * BLOCK), rule);
  }
  InformationSums all;
  for (const InformationSums& block : sums) {
    all.held += block.held;
    all.possible += block.possible;
  }
  return all.possible > 0.0 ? all.held / all.possible : 0.0;
}

// What the sums and the states of the voxels make of a chunk's cells. While summing, `unseen` holds the count.
void finish_chunk(const Grid& grid, const GainField& field, const VoxelStates& voxels, std::int64_t chunk) {
  std::int64_t n_gaussians = 0, n_populated = 0;
  for_runs_of(grid, chunk / field.chunks[1], chunk % field.chunks[1], [&](std::int64_t first, std::int64_t n) {
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

void gather_gain(const Grid& grid, const GridPlace& place, const InformedMap& map, const VoxelStates& voxels,
                 const GatherRule& rule, const GainField& field) {
  std::vector<std::int64_t> chunks;
  std::int64_t first_column = grid.shape[0], last_column = 0;  // of the wanted ones
  for (std::int64_t c = 0; c < field.chunks[0] * field.chunks[1]; ++c) {
    if (field.wanted[c] == 0) continue;
    chunks.push_back(c);
    first_column = std::min(first_column, c / field.chunks[1] * CHUNK);
    last_column = std::max(last_column, std::min((c / field.chunks[1] + 1) * CHUNK, grid.shape[0]));
  }
  if (chunks.empty()) return;
  std::vector<GatheredBlock> blocks;
  for (std::int64_t first = 0; first < map.n; first += BLOCK) {
    const float* bounds = map.block_bounds + 6 * (first / BLOCK);
    if (any_wanted(chunks_of(bounds, bounds + 3, place, field), field)) blocks.push_back({first, 0, 0, 0});
  }
  const auto share = static_cast<float>(uncovered_share(map, rule));
  const GatherBox box{{static_cast<float>(place.lower[0]), static_cast<float>(place.lower[1]),
                       static_cast<float>(place.lower[2])},
                      static_cast<float>(place.cell),
                      {static_cast<std::int32_t>(grid.shape[0]), static_cast<std::int32_t>(grid.shape[1]),
                       static_cast<std::int32_t>(grid.shape[2])},
                      static_cast<std::int32_t>(field.chunks[1]),
                      field.wanted};
  static thread_local Scratch<GatherEntry> scratch;  // its pages cost more than the work done in them
  GatherEntry* entries = scratch.require(blocks.size() * BLOCK);
  const auto n_blocks = static_cast<std::int64_t>(blocks.size());
  const auto n_chunks = static_cast<std::int64_t>(chunks.size());
  const std::int64_t plane = grid.shape[1] * grid.shape[2];

#pragma omp parallel
  {
#pragma omp for schedule(dynamic, 1)
    for (std::int64_t c = 0; c < n_chunks; ++c) {
      for_runs_of(grid, chunks[c] / field.chunks[1], chunks[c] % field.chunks[1],
                  [&](std::int64_t first, std::int64_t n) { std::fill_n(field.cells + first, n, PanoramaCell{}); });
    }
#pragma omp for schedule(dynamic, 16)
    for (std::int64_t b = 0; b < n_blocks; ++b) {
      GatheredBlock& block = blocks[b];
      GatherEntry* own = entries + b * BLOCK;
      block.n_entries = variant_kernels().gain.gather(rows_from(map, block.first_row), box, rule, share, own);
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
        cell.quality += own[e].quality;
        cell.unseen += 1.0f;
      }
    }
#pragma omp barrier
#pragma omp for schedule(dynamic, 1)
    for (std::int64_t c = 0; c < n_chunks; ++c) finish_chunk(grid, field, voxels, chunks[c]);
  }
}

}  // namespace hgs

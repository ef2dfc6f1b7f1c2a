// `GatherRows` of one instruction set (see gain_gather.cpp for the formula).
// Included only by the variant files (see simd.hpp).
#pragma once
#include "gain_rows.hpp"
#include "parameter_column_variant.hpp"
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

static int gather_rows(const float* parameters, int n, const GatherBox& box, float min_opacity, GatherEntry* entries) {
  constexpr float TWO_PI = 6.28318531f;
  alignas(64) float centre[3][PADDED_BLOCK], log_radius[PADDED_BLOCK], logit[PADDED_BLOCK];
  for (int a = 0; a < 3; ++a) column_of(parameters, n, a, centre[a]);
  column_of(parameters, n, 6, log_radius);
  column_of(parameters, n, 7, logit);
  const float per_metre = 1.0f / box.cell, per_face = 1.0f / (box.cell * box.cell);
  alignas(64) float depths[LANES];
  alignas(64) std::int32_t voxels[LANES], chunks[LANES];
  int n_entries = 0;
  for (int base = 0; base < n; base += LANES) {
    VInt i = to_cell((load(centre[0] + base) - box.lower[0]) * per_metre);
    VInt j = to_cell((load(centre[1] + base) - box.lower[1]) * per_metre);
    VInt k = to_cell((load(centre[2] + base) - box.lower[2]) * per_metre);
    const VFloat opacity = 1.0f / (1.0f + vexp(-load(logit + base)));
    const VInt kept = (i >= 0) & (i < box.shape[0]) & (j >= 0) & (j < box.shape[1]) & (k >= 0) & (k < box.shape[2]) &
                      (opacity >= min_opacity);
    if (!any(kept)) continue;
    i &= kept;  // what lies far outside has no index
    j &= kept;
    k &= kept;
    const VFloat radius = vexp(load(log_radius + base));
    store(depths, opacity * (TWO_PI * per_face) * radius * radius);
    store(voxels, (i * box.shape[1] + j) * box.shape[2] + k);
    store(chunks, kept ? (i >> CHUNK_SHIFT) * box.chunks_y + (j >> CHUNK_SHIFT) : VInt{} - 1);
    const int left = n - base < LANES ? n - base : LANES;
    for (int lane = 0; lane < left; ++lane) {
      if (chunks[lane] < 0 || box.wanted[chunks[lane]] == 0) continue;
      entries[n_entries++] = {voxels[lane], depths[lane]};
    }
  }
  return n_entries;
}

}  // namespace hgs::HGS_VARIANT

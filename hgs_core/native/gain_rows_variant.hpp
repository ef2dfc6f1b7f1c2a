// `GatherRows` and `SumInformation` of one instruction set (see gain_gather.cpp for the formulas).
// Included only by the variant files (see simd.hpp).
#pragma once
#include "gain_rows.hpp"
#include "rasterise.hpp"
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

inline constexpr float PI = 3.14159265f;

inline constexpr int COLUMN = BLOCK + 16;  // columns not a power of two apart

// Columns of up to BLOCK rows of 8, padded with zeros to whole vectors.
HGS_INLINE void transpose(const float* rows, int n, float (*columns)[COLUMN]) {
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < 8; ++k) columns[k][i] = rows[8 * i + k];
  }
  for (int k = 0; k < 8; ++k) {
    for (int i = n; i < (n + LANES - 1) / LANES * LANES; ++i) columns[k][i] = 0.0f;
  }
}

HGS_INLINE VFloat opacity_of(VFloat logit) { return 1.0f / (1.0f + vexp(-logit)); }

// Colour information of bare splats from 1 m: pi o^2 (f r)^2.
HGS_INLINE VFloat bare_information(VFloat opacity, VFloat radius, const GatherRule& rule) {
  const VFloat strength = opacity * radius * rule.focal_px;
  return PI * strength * strength;
}

static int gather_rows(const InformedRows& rows, const GatherBox& box, const GatherRule& rule, float uncovered_share,
                       GatherEntry* entries) {
  alignas(64) float p[8][COLUMN], h[8][COLUMN];
  transpose(rows.parameters, rows.n, p);
  transpose(rows.information, rows.n, h);
  alignas(64) float weights[COLUMN] = {};
  for (int i = 0; i < rows.n; ++i) weights[i] = rows.weight[i];
  const float per_metre = 1.0f / box.cell, per_face = 1.0f / (box.cell * box.cell);
  alignas(64) float depths[LANES], qualities[LANES];
  alignas(64) std::int32_t voxels[LANES], chunks[LANES];
  int n_entries = 0;
  for (int base = 0; base < rows.n; base += LANES) {
    const VInt i = to_cell((load(p[0] + base) - box.lower[0]) * per_metre);
    const VInt j = to_cell((load(p[1] + base) - box.lower[1]) * per_metre);
    const VInt k = to_cell((load(p[2] + base) - box.lower[2]) * per_metre);
    const VFloat opacity = opacity_of(load(p[7] + base));
    const VInt kept = (i >= 0) & (i < box.shape[0]) & (j >= 0) & (j < box.shape[1]) & (k >= 0) & (k < box.shape[2]) &
                      (opacity >= rule.min_opacity);
    if (!any(kept)) continue;
    const VFloat radius = vexp(load(p[6] + base));
    VFloat settled{};
    for (int column = 0; column < 8; ++column) {
      const VFloat held = load(h[column] + base);
      settled += held / (held + rule.prior);
    }
    const VFloat colour = (load(h[3] + base) + load(h[4] + base) + load(h[5] + base)) * (1.0f / 3.0f);
    const VInt seen = (load(weights + base) > 0.0f) & (colour > 0.0f);
    const VFloat expected = uncovered_share * bare_information(opacity, radius, rule);
    const VFloat promised = expected / (seen ? colour : splat_all(1.0f)) * settled;
    store(qualities, seen ? vmin(promised, splat_all(rule.max_quality)) : splat_all(rule.unseen_quality));
    store(depths, opacity * (2.0f * PI * per_face) * radius * radius);
    const VInt voxel = (i * box.shape[1] + j) * box.shape[2] + k;
    const VInt chunk = (i >> CHUNK_SHIFT) * box.chunks_y + (j >> CHUNK_SHIFT);
    store(voxels, voxel);
    store(chunks, kept ? chunk : VInt{} - 1);
    const int n = rows.n - base < LANES ? rows.n - base : LANES;
    for (int lane = 0; lane < n; ++lane) {
      if (chunks[lane] < 0 || box.wanted[chunks[lane]] == 0) continue;
      entries[n_entries++] = {voxels[lane], depths[lane], qualities[lane]};
    }
  }
  return n_entries;
}

static InformationSums information_sums(const InformedRows& rows, const GatherRule& rule) {
  alignas(64) float p[8][COLUMN], h[8][COLUMN];
  transpose(rows.parameters, rows.n, p);
  transpose(rows.information, rows.n, h);
  alignas(64) float opacities[LANES], bare[LANES];
  InformationSums sums;
  for (int base = 0; base < rows.n; base += LANES) {
    const VFloat opacity = opacity_of(load(p[7] + base));
    store(opacities, opacity);
    store(bare, bare_information(opacity, vexp(load(p[6] + base)), rule));
    const int n = rows.n - base < LANES ? rows.n - base : LANES;
    for (int lane = 0; lane < n; ++lane) {
      if (opacities[lane] < rule.min_opacity) continue;
      sums.held += (h[3][base + lane] + h[4][base + lane] + h[5][base + lane]) * (1.0f / 3.0f);
      sums.possible += double{bare[lane]} * rows.weight[base + lane];
    }
  }
  return sums;
}

}  // namespace hgs::HGS_VARIANT

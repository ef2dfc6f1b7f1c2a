// The two sweeps over one tile: all its splats front to back, and for each the patches it touches.
// Included only by the variant files (see simd.hpp).
//
// The forward sweep keeps what it worked out of every splat, its trace, for a second sweep. That runs front to back
// as well: with q_i = dL/dw_i and S = sum_{j > i} q_j w_j (the final sum less what has gone by),
// dL/dalpha_i = T_i q_i - S / (1 - alpha_i): no alphas are stored.
#pragma once
#include "rasterise_sums.hpp"

namespace hgs::HGS_VARIANT {

inline constexpr int BATCH = 16;  // splats between two looks for patches that have gone opaque
inline constexpr std::uint32_t PREFETCH_SUMS = 8;  // splats ahead of the one that is written

// T and the running sums.
enum { T_PLANE, R_PLANE, G_PLANE, B_PLANE, D_PLANE, FORWARD_PLANES };
using ForwardTile = TilePlanes<FORWARD_PLANES>;

// Bit i: some pixel of patch i still lets light through.
HGS_INLINE std::uint32_t open_patches(const ForwardTile& state) {
  std::uint32_t open = 0;
  for (int patch = 0; patch < PATCHES; ++patch) {
    VFloat most{};
    for (int part = 0; part < PARTS; ++part) most = vmax(most, load(state.patches[patch][T_PLANE] + part * LANES));
    const bool through = mask_bits(at_least(most, splat_all(MIN_TRANSMITTANCE))) != 0;
    open |= static_cast<std::uint32_t>(through) << patch;
  }
  return open;
}

template <class Trace>
HGS_INLINE void draw(const Trace& trace, const TileFrame& frame, std::uint32_t patch, ForwardTile& state) {
  for (int part = 0; part < PARTS; ++part) {
    float* pixels = state.patches[patch][0] + part * LANES;
    const VFloat T = load(pixels + T_PLANE * PATCH);
    const auto here = footprint(trace, frame, patch, part);
    const VFloat weight = masked_alpha(here.a, T) * T;
    store(pixels + T_PLANE * PATCH, T - weight);
    store(pixels + R_PLANE * PATCH, load(pixels + R_PLANE * PATCH) + trace.spot.r * weight);
    store(pixels + G_PLANE * PATCH, load(pixels + G_PLANE * PATCH) + trace.spot.g * weight);
    store(pixels + B_PLANE * PATCH, load(pixels + B_PLANE * PATCH) + trace.spot.b * weight);
    store(pixels + D_PLANE * PATCH, load(pixels + D_PLANE * PATCH) + here.depth * weight);
  }
}

// What a forward sweep leaves behind: the traces of a tile's first `n` entries, up to where it went opaque.
template <class Shape>
struct Traces {
  const typename Shape::Trace* first;
  std::uint32_t n;
};

// A batch is traced first and drawn then: with its (splat, patch) pairs in one list, no loop ends after a number of
// patches that the processor cannot foresee.
template <class Shape>
static Traces<Shape> sweep_forward(const Tile& tile, const typename Shape::Splat* splats, ForwardTile& state,
                                   typename Shape::Trace* traces) {
  TileFrame frame;
  frame_tile(tile, frame);
  std::uint32_t items[BATCH * PATCHES + PATCHES];  // PATCHES * number in the batch + patch
  for (std::uint32_t first = 0; first < tile.n_entries; first += BATCH) {
    const std::uint32_t open = open_patches(state);
    if (open == 0) return {traces, first};
    const std::uint32_t left = tile.n_entries - first, count = left < BATCH ? left : BATCH;
    typename Shape::Trace* batch = traces + first;
    int n_items = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
      const TileEntry entry = tile.entries[first + i];
      if (i + BATCH < left) __builtin_prefetch(&splats[tile.entries[first + i + BATCH].slot]);
      trace(splats[entry.slot], entry, frame, open, batch[i]);
      n_items += list_bits(batch[i].patches, PATCHES * i, items + n_items);
    }
    for (int k = 0; k < n_items; ++k) draw(batch[items[k] / PATCHES], frame, items[k] % PATCHES, state);
  }
  return {traces, tile.n_entries};
}

// Gradients with respect to C, D and A (dr .. da), T, and S = the part of dL/dw . w still to come.
enum { GT_PLANE, S_PLANE, DR_PLANE, DG_PLANE, DB_PLANE, DD_PLANE, DA_PLANE, GRADIENT_PLANES };
using GradientTile = TilePlanes<GRADIENT_PLANES>;

template <class Shape>
static void sweep_backward(const Tile& tile, Traces<Shape> traces, GradientTile& state, float* pair_sums) {
  TileFrame frame;
  frame_tile(tile, frame);
  BackwardOrigins<Shape> origins;
  for (std::uint32_t i = 0; i < traces.n; ++i) {
    const typename Shape::Trace& trace = traces.first[i];
    origins.see_from(trace.spot, frame);
    const std::uint32_t ahead = i + PREFETCH_SUMS < traces.n ? i + PREFETCH_SUMS : i;
    __builtin_prefetch(pair_sums + Shape::SUMS * std::size_t{traces.first[ahead].entry.pair}, 1);
    const VFloat red = splat_all(trace.spot.r), green = splat_all(trace.spot.g), blue = splat_all(trace.spot.b);
    BackwardSums<Shape> sums;
    for (std::uint32_t bits = trace.patches; bits != 0; bits &= bits - 1) {
      const std::uint32_t patch = static_cast<std::uint32_t>(__builtin_ctz(bits));
      for (int part = 0; part < PARTS; ++part) {
        float* pixels = state.patches[patch][0] + part * LANES;
        const VFloat T = load(pixels + GT_PLANE * PATCH);
        const auto here = footprint(trace, frame, patch, part);
        const VFloat alpha = masked_alpha(here.a, T);
        const VFloat weight = alpha * T;
        const VFloat dr = load(pixels + DR_PLANE * PATCH), dg = load(pixels + DG_PLANE * PATCH);
        const VFloat db = load(pixels + DB_PLANE * PATCH), dd = load(pixels + DD_PLANE * PATCH);
        const VFloat q = dr * red + (dg * green + (db * blue + (dd * here.depth + load(pixels + DA_PLANE * PATCH))));
        const VFloat qw = q * weight;
        const VFloat S = load(pixels + S_PLANE * PATCH) - qw;
        store(pixels + GT_PLANE * PATCH, T - weight);
        store(pixels + S_PLANE * PATCH, S);
        const VMask free = at_least(splat_all(MAX_ALPHA), here.a);
        const VFloat P = where(free, qw - S * (alpha * inverse(1.0f - alpha)));
        sums.add(here, P, dr * weight, dg * weight, db * weight, dd * weight, origins, patch, part);
      }
    }
    sums.write(pair_sums + Shape::SUMS * std::size_t{trace.entry.pair});
  }
}

}  // namespace hgs::HGS_VARIANT

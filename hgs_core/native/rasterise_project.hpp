// From the map to the screen: every row of the visible blocks becomes a Splat or is dropped.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "rasterise_workspace.hpp"
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

struct LaneSpans {
  VInt x, y, mask, count;
};

// TileSpan of each lane: row by row, the chord of the disc along the tile's nearest line of pixels.
HGS_INLINE LaneSpans tile_spans(VFloat u, VFloat v, VFloat reach, int tiles_x, int tiles_y) {
  const VFloat zero{}, last_x = splat_all(tiles_x - 1.0f), last_y = splat_all(tiles_y - 1.0f);
  const VFloat reach2 = reach * reach;
  // Limits before the conversion: a splat next to the camera may reach beyond what an int holds.
  const auto first = [&](VFloat low, float size, VFloat most) HGS_LAMBDA {
    return to_int(vmin(vmax((low - (size - 0.5f)) * (1.0f / size) + 1.0f, zero), most + 1.0f));
  };
  const auto last = [&](VFloat high, float size, VFloat most) HGS_LAMBDA {
    return to_int(vmax(vmin((high - 0.5f) * (1.0f / size), most), splat_all(-1.0f)) + 1.0f) - 1;
  };
  LaneSpans spans;
  spans.x = first(u - reach, TILE_W, last_x);
  spans.y = first(v - reach, TILE_H, last_y);
  const VInt end_x = last(u + reach, TILE_W, last_x), end_y = last(v + reach, TILE_H, last_y);
  spans.mask = VInt{};
  spans.count = VInt{};
  for (int i = 0; i < SPAN; ++i) {
    const VInt ty = spans.y + i;
    const VFloat top = to_float(ty) * TILE_H + 0.5f;
    const VFloat dy = vmax(vmax(top - v, v - (top + (TILE_H - 1.0f))), zero);
    const VFloat chord = vsqrt(vmax(reach2 - dy * dy, zero));
    const VInt from = first(u - chord, TILE_W, last_x) - spans.x, to = last(u + chord, TILE_W, last_x) - spans.x;
    const VInt there = (ty <= end_y) & (to >= from) & (from >= 0) & (to < SPAN);
    const VInt one = VInt{} + 1;
    const VInt shift_from = there ? from : VInt{}, shift_to = there ? to : VInt{};
    const VInt bits = (one << (shift_to + 1)) - (one << shift_from);
    spans.mask |= there ? bits << (SPAN * i) : VInt{};
    spans.count += there ? shift_to - shift_from + 1 : VInt{};
  }
  const VInt fits = (end_x - spans.x < SPAN) & (end_y - spans.y < SPAN);
  spans.mask = fits ? spans.mask : VInt{};
  return spans;
}

// Order-preserving.
HGS_INLINE VInt depth_keys(VFloat z) {
  constexpr std::int32_t MOST = (1 << DEPTH_KEY_BITS) - 1;
  const VFloat nearest = splat_all(NEAR_M);
  const VInt key = ((VInt)vmax(z, nearest) - (VInt)nearest) >> DEPTH_KEY_DROPPED;
  return key < MOST ? key : VInt{} + MOST;
}

// Projects up to BLOCK rows; returns how many splats may touch a pixel.
static std::uint32_t project_block(const float* parameters, std::uint32_t first_row, int n_rows,
                                   const PinholeCamera& camera, int tiles_x, int tiles_y, Splat* splats,
                                   TileSpan* spans) {
  alignas(64) float columns[N_PARAMETERS][BLOCK + 16];  // + 16: columns not a power of two apart
  for (int i = 0; i < n_rows; ++i) {
    for (int k = 0; k < N_PARAMETERS; ++k) columns[k][i] = parameters[N_PARAMETERS * i + k];
  }
  const int padded = (n_rows + LANES - 1) / LANES * LANES;
  for (int i = n_rows; i < padded; ++i) {
    for (int k = 0; k < N_PARAMETERS; ++k) columns[k][i] = 0.0f;
  }
  const float* R = camera.rotation;
  const float* t = camera.translation;
  const float f2 = camera.fx * camera.fy;
  alignas(64) float us[LANES], vs[LANES], falloffs[LANES], opacities[LANES], zs[LANES], reaches[LANES], own[LANES];
  std::uint32_t n_splats = 0;
  for (int base = 0; base < padded; base += LANES) {
    const VFloat x = load(columns[0] + base), y = load(columns[1] + base), w = load(columns[2] + base);
    const VFloat z = R[6] * x + R[7] * y + R[8] * w + t[2];
    VInt kept = (z > NEAR_M) & (z < camera.far_m);
    if (!any(kept)) continue;
    const VFloat inverse_z = 1.0f / vmax(z, splat_all(NEAR_M));
    const VFloat u = camera.fx * (R[0] * x + R[1] * y + R[2] * w + t[0]) * inverse_z + camera.cx;
    const VFloat v = camera.fy * (R[3] * x + R[4] * y + R[5] * w + t[1]) * inverse_z + camera.cy;
    const VFloat radius = vexp(load(columns[6] + base)) * inverse_z;
    const VFloat own_variance = f2 * radius * radius;
    const VFloat falloff = 0.72134752f / (own_variance + camera.low_pass_px2);  // log2(e) / 2
    const VFloat opacity = 1.0f / (1.0f + vexp(-load(columns[7] + base)));
    const VFloat decay = vlog2_rough(vmax(opacity * 255.0f, splat_all(0.5f))) + 1e-3f;
    const VFloat reach = vsqrt(vmax(decay, splat_all(0.0f)) / falloff) + 0.01f;
    kept = kept & (decay > 0.0f) & (u + reach >= 0.5f) & (u - reach <= camera.width - 0.5f) &
           (v + reach >= 0.5f) & (v - reach <= camera.height - 0.5f);
    if (!any(kept)) continue;
    store(us, u);
    store(vs, v);
    store(falloffs, falloff);
    store(opacities, opacity);
    store(zs, z);
    store(reaches, reach);
    store(own, own_variance);
    const VInt keys = depth_keys(z);
    const LaneSpans tiles = tile_spans(u, v, reach, tiles_x, tiles_y);
    for (int lane = 0; lane < LANES; ++lane) {
      if (kept[lane] == 0 || base + lane >= n_rows) continue;
      const int i = base + lane;
      spans[n_splats] = {0,
                         static_cast<std::uint32_t>(keys[lane]),
                         static_cast<std::uint16_t>(tiles.x[lane]),
                         static_cast<std::uint16_t>(tiles.y[lane]),
                         static_cast<std::uint16_t>(tiles.mask[lane]),
                         static_cast<std::uint16_t>(tiles.count[lane])};
      Splat& splat = splats[n_splats++];
      splat.u = us[lane];
      splat.v = vs[lane];
      splat.falloff = falloffs[lane];
      splat.opacity = opacities[lane];
      splat.r = columns[3][i];
      splat.g = columns[4][i];
      splat.b = columns[5][i];
      splat.z = zs[lane];
      splat.reach = reaches[lane];
      splat.own_variance = own[lane];
      splat.row = first_row + static_cast<std::uint32_t>(i);
    }
  }
  return n_splats;
}

// Culls, projects, sorts, bins.
static void prepare(const GaussianRows& gaussians, const PinholeCamera& camera, Workspace& workspace) {
  cull_blocks(gaussians, camera, workspace);
  const std::size_t n_blocks = workspace.n_visible_blocks;
  const std::uint32_t* blocks = workspace.visible_blocks.get();
  Splat* splats = workspace.splats.require(n_blocks * BLOCK);
  TileSpan* spans = workspace.spans.require(n_blocks * BLOCK);
  std::uint32_t* counts = workspace.block_splats.require(n_blocks);
  workspace.tiles_x = (camera.width + TILE_W - 1) / TILE_W;
  workspace.tiles_y = (camera.height + TILE_H - 1) / TILE_H;
#pragma omp parallel
  {
    const FlushDenormals flush;
#pragma omp for schedule(dynamic, 8)
    for (std::size_t i = 0; i < n_blocks; ++i) {
      const std::size_t first = std::size_t{blocks[i]} * BLOCK;
      const std::size_t left = gaussians.n - first;
      const int n_rows = left < BLOCK ? static_cast<int>(left) : BLOCK;
      counts[i] = project_block(gaussians.parameters + N_PARAMETERS * first, static_cast<std::uint32_t>(first),
                                n_rows, camera, workspace.tiles_x, workspace.tiles_y, splats + i * BLOCK,
                                spans + i * BLOCK);
    }
  }
  bin_splats(workspace);
}

}  // namespace hgs::HGS_VARIANT

// From the map to the screen: every row of the visible blocks becomes a splat or is dropped.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "rasterise_looks.hpp"
#include "rasterise_workspace.hpp"
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

struct LaneSpans {
  VInt x, y, mask, count;
};

// TileSpan of each lane: row by row, the tiles that the splat's chord along the tile's pixels touches.
template <class Look>
HGS_INLINE LaneSpans tile_spans(VFloat u, VFloat v, const Look& look, int tiles_x, int tiles_y) {
  const VFloat zero{}, last_x = splat_all(tiles_x - 1.0f), last_y = splat_all(tiles_y - 1.0f);
  // Limits before the conversion: a splat next to the camera may reach beyond what an int holds.
  const auto first = [&](VFloat low, float size, VFloat most) HGS_LAMBDA {
    return to_int(vmin(vmax((low - (size - 0.5f)) * (1.0f / size) + 1.0f, zero), most + 1.0f));
  };
  const auto last = [&](VFloat high, float size, VFloat most) HGS_LAMBDA {
    return to_int(vmax(vmin((high - 0.5f) * (1.0f / size), most), splat_all(-1.0f)) + 1.0f) - 1;
  };
  LaneSpans spans;
  spans.x = first(u - look.reach_x, TILE_W, last_x);
  spans.y = first(v - look.reach_y, TILE_H, last_y);
  const VInt end_x = last(u + look.reach_x, TILE_W, last_x), end_y = last(v + look.reach_y, TILE_H, last_y);
  spans.mask = VInt{};
  spans.count = VInt{};
  for (int i = 0; i < SPAN; ++i) {
    const VInt ty = spans.y + i;
    const VFloat top = to_float(ty) * TILE_H + 0.5f;
    const LaneChord chord = look.chord(top - v, v - (top + (TILE_H - 1.0f)));
    // By rounding a chord may reach farther than the whole splat.
    const VInt left = first(u - chord.left, TILE_W, last_x), right = last(u + chord.right, TILE_W, last_x);
    const VInt from = (left > spans.x ? left : spans.x) - spans.x, to = (right < end_x ? right : end_x) - spans.x;
    const VInt there = (ty <= end_y) & (to >= from) & (to < SPAN);
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

// `N` columns of up to BLOCK rows, padded with zeros to whole vectors.
template <int N>
HGS_INLINE void columns_of(const float* rows, int n_rows, float (*columns)[BLOCK + 16]) {
  for (int i = 0; i < n_rows; ++i) {
    for (int k = 0; k < N; ++k) columns[k][i] = rows[N * i + k];
  }
  const int padded = (n_rows + LANES - 1) / LANES * LANES;
  for (int i = n_rows; i < padded; ++i) {
    for (int k = 0; k < N; ++k) columns[k][i] = 0.0f;
  }
}

// Projects the rows of a block from `first_row` on; returns how many splats may touch a pixel. `limits`, unless null:
// splats beyond them are hidden.
template <class Shape>
static std::uint32_t project_block(const GaussianRows& gaussians, std::uint32_t first_row, int n_rows,
                                   const PinholeCamera& camera, int tiles_x, int tiles_y, const TileLimits* limits,
                                   typename Shape::Splat* splats, TileSpan* spans) {
  alignas(64) float columns[N_PARAMETERS][BLOCK + 16];  // + 16: columns not a power of two apart
  columns_of<N_PARAMETERS>(gaussians.parameters + N_PARAMETERS * std::size_t{first_row}, n_rows, columns);
  LookFrom<Shape> look_from(gaussians, first_row, n_rows, camera);
  const float* R = camera.rotation;
  const float* t = camera.translation;
  alignas(64) float us[LANES], vs[LANES], opacities[LANES], zs[LANES];
  std::uint32_t n_splats = 0;
  for (int base = 0; base < n_rows; base += LANES) {
    const VFloat x = load(columns[0] + base), y = load(columns[1] + base), w = load(columns[2] + base);
    const VFloat z = R[6] * x + R[7] * y + R[8] * w + t[2];
    VInt kept = (z > NEAR_M) & (z < camera.far_m);
    if (!any(kept)) continue;
    const VFloat inverse_z = 1.0f / vmax(z, splat_all(NEAR_M));
    const VFloat right = R[0] * x + R[1] * y + R[2] * w + t[0], down = R[3] * x + R[4] * y + R[5] * w + t[1];
    const VFloat u = camera.fx * right * inverse_z + camera.cx;
    const VFloat v = camera.fy * down * inverse_z + camera.cy;
    const VFloat radius = vexp(load(columns[6] + base)) * inverse_z;
    const VFloat opacity = 1.0f / (1.0f + vexp(-load(columns[7] + base)));
    const VFloat decay = vlog2_rough(vmax(opacity * 255.0f, splat_all(0.5f))) + 1e-3f;
    const auto look = look_from(base, right * inverse_z, down * inverse_z, z, radius, vmax(decay, splat_all(0.0f)));
    kept = kept & (decay > 0.0f) & (u + look.reach_x >= 0.5f) & (u - look.reach_x <= camera.width - 0.5f) &
           (v + look.reach_y >= 0.5f) & (v - look.reach_y <= camera.height - 0.5f);
    if (!any(kept)) continue;
    store(us, u);
    store(vs, v);
    store(opacities, opacity);
    store(zs, z);
    StoredLook<Shape> stored;
    stored.keep(look);
    const VInt keys = depth_keys(z);
    const LaneSpans tiles = tile_spans(u, v, look, tiles_x, tiles_y);
    for (int lane = 0; lane < LANES; ++lane) {
      if (kept[lane] == 0 || base + lane >= n_rows) continue;
      int mask = tiles.mask[lane], count = tiles.count[lane];
      if (limits != nullptr && mask != 0) {
        mask = limits->in_sight(tiles.x[lane], tiles.y[lane], mask, zs[lane]);
        if (mask == 0) continue;
        count = __builtin_popcount(static_cast<unsigned>(mask));
      }
      const int i = base + lane;
      spans[n_splats] = {0,
                         static_cast<std::uint32_t>(keys[lane]),
                         static_cast<std::uint16_t>(tiles.x[lane]),
                         static_cast<std::uint16_t>(tiles.y[lane]),
                         static_cast<std::uint16_t>(mask),
                         static_cast<std::uint16_t>(count)};
      typename Shape::Splat& splat = splats[n_splats++];
      splat.u = us[lane];
      splat.v = vs[lane];
      splat.opacity = opacities[lane];
      splat.r = columns[3][i];
      splat.g = columns[4][i];
      splat.b = columns[5][i];
      splat.z = zs[lane];
      splat.row = first_row + static_cast<std::uint32_t>(i);
      stored.give(lane, splat);
    }
  }
  return n_splats;
}

// Culls, projects, sorts, bins. `limits`, unless null: of every tile, beyond which depth splats are hidden.
template <class Shape>
static void prepare(const GaussianRows& gaussians, const PinholeCamera& camera, const TileLimits* limits,
                    Workspace& workspace) {
  cull_blocks(gaussians, camera, limits, workspace);
  const std::size_t n_blocks = workspace.n_visible_blocks;
  const std::uint32_t* blocks = workspace.visible_blocks.get();
  typename Shape::Splat* splats = workspace.of<Shape>().splats.require(n_blocks * BLOCK);
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
      counts[i] = project_block<Shape>(gaussians, static_cast<std::uint32_t>(first), n_rows, camera, workspace.tiles_x,
                                       workspace.tiles_y, limits, splats + i * BLOCK, spans + i * BLOCK);
    }
  }
  bin_splats<Shape>(workspace);
}

// The same, without what `surface`, a depth image, hides; null: nothing.
template <class Shape>
static void prepare_before(const GaussianRows& gaussians, const PinholeCamera& camera, const float* surface,
                           Workspace& workspace) {
  if (surface == nullptr) return prepare<Shape>(gaussians, camera, nullptr, workspace);
  const TileLimits limits = tile_limits(surface, camera, workspace);
  prepare<Shape>(gaussians, camera, &limits, workspace);
}

}  // namespace hgs::HGS_VARIANT

// How a tile's pixels lie in memory, and which splats reach which of them.
// Included only by the variant files (see simd.hpp).
//
// A tile is cut into patches of 4 x 4 pixels: a disc touches fewer of these than rows of 16 pixels.
// An isotropic splat separates: a = (o 2^(-k dy^2)) 2^(-k dx^2), so a tile costs exponentials per row and per
// column, none per pixel.
#pragma once
#include "rasterise_workspace.hpp"
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

inline constexpr int EDGE = 4;                  // of a patch
inline constexpr int PATCH = EDGE * EDGE;       // pixels of a patch
inline constexpr int PATCHES_X = TILE_W / EDGE;
inline constexpr int PATCHES = PATCHES_X * (TILE_H / EDGE);
inline constexpr int PARTS = PATCH / LANES;     // vectors of a patch, one below the other
inline constexpr int PART_ROWS = LANES / EDGE;
static_assert(PATCHES == 16 && PATCHES % LANES == 0);

struct Tile {
  float x0, y0;                // centre of its first pixel
  const TileEntry* entries;
  std::uint32_t n_entries;
};

// Several values of every pixel; a patch's planes lie together.
template <int N_PLANES>
struct alignas(64) TilePlanes {
  float patches[PATCHES][N_PLANES][PATCH];
};

struct PixelPlace {
  int patch, lane;
};

HGS_INLINE PixelPlace place_of(int x, int y) {
  return {(y / EDGE) * PATCHES_X + x / EDGE, (y % EDGE) * EDGE + x % EDGE};
}

// T, a tile's first plane, before anything is drawn: 1 in the image's `width` x `height` pixels of the tile and 0
// (opaque) outside.
template <int N_PLANES>
HGS_INLINE void fill_transmittance(TilePlanes<N_PLANES>& tile, int width, int height) {
  const bool whole = width == TILE_W && height == TILE_H;
  for (int patch = 0; patch < PATCHES; ++patch) {
    for (int i = 0; i < PATCH; i += LANES) store(tile.patches[patch][0] + i, splat_all(whole ? 1.0f : 0.0f));
  }
  if (whole) return;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) tile.patches[place_of(x, y).patch][0][place_of(x, y).lane] = 1.0f;
  }
}

// Centre of the patch that a vector's lane i stands for, for patches first .. first + LANES - 1, from the tile's
// first pixel.
HGS_INLINE VFloat patch_x(int first) {
  VFloat x;
  for (int i = 0; i < LANES; ++i) x[i] = (first + i) % PATCHES_X * EDGE + 0.5f * (EDGE - 1);
  return x;
}

HGS_INLINE VFloat patch_y(int first) {
  VFloat y;
  for (int i = 0; i < LANES; ++i) y[i] = (first + i) / PATCHES_X * EDGE + 0.5f * (EDGE - 1);
  return y;
}

HGS_INLINE VFloat lane_numbers() {
  VFloat lanes;
  for (int i = 0; i < LANES; ++i) lanes[i] = static_cast<float>(i);
  return lanes;
}

// Bit i: some pixel of patch i lies within the splat's reach.
HGS_INLINE std::uint32_t patches_within(float u, float v, float reach) {
  const VFloat half = splat_all(0.5f * (EDGE - 1)), reach2 = splat_all(reach * reach);
  std::uint32_t bits = 0;
  for (int first = 0; first < PATCHES; first += LANES) {
    const VFloat dx = vmax(vabs(patch_x(first) - u) - half, VFloat{});
    const VFloat dy = vmax(vabs(patch_y(first) - v) - half, VFloat{});
    bits |= mask_bits(at_least(reach2, dx * dx + dy * dy)) << first;
  }
  return bits;
}

HGS_INLINE void trace(const Splat& splat, TileEntry entry, const Tile& tile, std::uint32_t open, Trace& out) {
  const float u = splat.u - tile.x0, v = splat.v - tile.y0;
  const float falloff = -splat.falloff;
  for (int j = 0; j < TILE_W; j += LANES) {
    const VFloat dx = lane_numbers() + (static_cast<float>(j) - u);
    store(out.along + j, vexp2(falloff * dx * dx));
  }
  for (int j = 0; j < TILE_H; j += LANES) {
    const VFloat dy = lane_numbers() + (static_cast<float>(j) - v);
    store(out.down + j, splat.opacity * vexp2(falloff * dy * dy));
  }
  out.r = splat.r;
  out.g = splat.g;
  out.b = splat.b;
  out.z = splat.z;
  out.u = u;
  out.v = v;
  out.patches = patches_within(u, v, splat.reach) & open;
  out.entry = entry;
}

// o 2^(-k d^2) in one vector of a patch.
HGS_INLINE VFloat footprint(const Trace& trace, std::uint32_t patch, int part) {
  const float* along = trace.along + patch % PATCHES_X * EDGE;
  const float* down = trace.down + patch / PATCHES_X * EDGE;
  return spread_columns(along) * spread_rows(down, part);
}

// min(a, MAX_ALPHA) where the splat counts, else 0.
HGS_INLINE VFloat masked_alpha(VFloat a, VFloat T, VMask& counts) {
  counts = at_least(at_least(T, splat_all(MIN_TRANSMITTANCE)), a, splat_all(MIN_ALPHA));
  return where(counts, vmin(a, splat_all(MAX_ALPHA)));
}

}  // namespace hgs::HGS_VARIANT

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

// Centres of patches first .. first + LANES - 1.
HGS_INLINE VFloat patch_x(const Tile& tile, int first) {
  VFloat x;
  for (int i = 0; i < LANES; ++i) x[i] = (first + i) % PATCHES_X * EDGE + 0.5f * (EDGE - 1);
  return x + tile.x0;
}

HGS_INLINE VFloat patch_y(const Tile& tile, int first) {
  VFloat y;
  for (int i = 0; i < LANES; ++i) y[i] = (first + i) / PATCHES_X * EDGE + 0.5f * (EDGE - 1);
  return y + tile.y0;
}

HGS_INLINE VFloat lane_numbers() {
  VFloat lanes;
  for (int i = 0; i < LANES; ++i) lanes[i] = static_cast<float>(i);
  return lanes;
}

// Bit i: some pixel of patch i lies within the splat's reach.
HGS_INLINE std::uint32_t patches_within(const Splat& splat, const Tile& tile) {
  constexpr float HALF = 0.5f * (EDGE - 1);
  const VFloat u = splat_all(splat.u), v = splat_all(splat.v), reach = splat_all(splat.reach);
  std::uint32_t bits = 0;
  for (int first = 0; first < PATCHES; first += LANES) {
    const VFloat x = patch_x(tile, first), y = patch_y(tile, first);
    const VFloat dx = u - vmax(vmin(u, x + HALF), x - HALF);  // from the patch's nearest pixel
    const VFloat dy = v - vmax(vmin(v, y + HALF), y - HALF);
    bits |= mask_bits(at_least(reach * reach, dx * dx + dy * dy)) << first;
  }
  return bits;
}

HGS_INLINE void trace(const Splat& splat, TileEntry entry, const Tile& tile, std::uint32_t open, Trace& out) {
  const VFloat falloff = splat_all(splat.falloff), opacity = splat_all(splat.opacity);
  for (int j = 0; j < TILE_W; j += LANES) {
    const VFloat dx = (lane_numbers() + (tile.x0 + static_cast<float>(j))) - splat.u;
    store(out.along + j, vexp2_minus(falloff * dx * dx));
  }
  for (int j = 0; j < TILE_H; j += LANES) {
    const VFloat dy = (lane_numbers() + (tile.y0 + static_cast<float>(j))) - splat.v;
    store(out.down + j, opacity * vexp2_minus(falloff * dy * dy));
  }
  out.spot = splat;
  out.entry = entry;
  out.patches = patches_within(splat, tile) & open;
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

// How a tile's pixels lie in memory, and which splats reach which of them.
// Included only by the variant files (see simd.hpp).
//
// A tile is cut into patches of 4 x 4 pixels: a splat touches a third fewer of these than rows of 16 pixels.
// A round splat separates: a = (o 2^(-k dy^2)) 2^(-k dx^2), so a tile costs exponentials per row and per
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
static_assert(PATCHES == 16);

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

// Where a tile's columns, rows and patches lie; a patch from the centre of its first to that of its last pixel [px].
struct TileFrame {
  alignas(64) float column[TILE_W], row[TILE_H];
  alignas(64) float left[PATCHES], right[PATCHES], top[PATCHES], bottom[PATCHES];
};

HGS_INLINE void frame_tile(const Tile& tile, TileFrame& frame) {
  for (int x = 0; x < TILE_W; ++x) frame.column[x] = tile.x0 + static_cast<float>(x);
  for (int y = 0; y < TILE_H; ++y) frame.row[y] = tile.y0 + static_cast<float>(y);
  for (int patch = 0; patch < PATCHES; ++patch) {
    frame.left[patch] = tile.x0 + static_cast<float>(patch % PATCHES_X * EDGE);
    frame.right[patch] = frame.left[patch] + (EDGE - 1);
    frame.top[patch] = tile.y0 + static_cast<float>(patch / PATCHES_X * EDGE);
    frame.bottom[patch] = frame.top[patch] + (EDGE - 1);
  }
}

// A lane's place from the first pixel of its vector.
HGS_INLINE VFloat lane_x() {
  VFloat x;
  for (int i = 0; i < LANES; ++i) x[i] = static_cast<float>(i % EDGE);
  return x;
}

HGS_INLINE VFloat lane_y() {
  VFloat y;
  for (int i = 0; i < LANES; ++i) y[i] = static_cast<float>(i / EDGE);
  return y;
}

// Bit i: some pixel of patch i lies within the splat's reach.
HGS_INLINE std::uint32_t patches_within(const RoundSplat& splat, const TileFrame& frame) {
  const VFloat u = splat_all(splat.u), v = splat_all(splat.v), reach = splat_all(splat.reach);
  std::uint32_t bits = 0;
  for (int first = 0; first < PATCHES; first += LANES) {
    const VFloat dx = u - vmax(vmin(u, load(frame.right + first)), load(frame.left + first));
    const VFloat dy = v - vmax(vmin(v, load(frame.bottom + first)), load(frame.top + first));
    bits |= mask_bits(at_least(reach * reach, dx * dx + dy * dy)) << first;
  }
  return bits;
}

HGS_INLINE VFloat exponent_of(const DiscSpot& spot, VFloat dx, VFloat dy) {
  const VFloat h = dx - spot.lean * dy;
  return spot.across * h * h + spot.down * dy * dy;
}

// The exponent is least, in a rectangle that (u, v) lies outside of, on one of the edges that face (u, v): on each at
// the foot of the edge, as far as the edge goes.
HGS_INLINE std::uint32_t patches_within(const DiscSplat& splat, const TileFrame& frame) {
  const float leant = splat.across * splat.lean, foot_y = leant / (leant * splat.lean + splat.down);
  std::uint32_t bits = 0;
  for (int first = 0; first < PATCHES; first += LANES) {
    const VFloat left = load(frame.left + first) - splat.u, right = load(frame.right + first) - splat.u;
    const VFloat top = load(frame.top + first) - splat.v, bottom = load(frame.bottom + first) - splat.v;
    const VFloat dx = vmax(vmin(VFloat{}, right), left), dy = vmax(vmin(VFloat{}, bottom), top);
    const VFloat upright = exponent_of(splat, dx, vmax(vmin(foot_y * dx, bottom), top));
    const VFloat level = exponent_of(splat, vmax(vmin(splat.lean * dy, right), left), dy);
    bits |= mask_bits(at_least(splat_all(splat.decay), vmin(upright, level))) << first;
  }
  return bits;
}

HGS_INLINE void trace(const RoundSplat& splat, TileEntry entry, const TileFrame& frame, std::uint32_t open,
                      RoundTrace& out) {
  const VFloat falloff = splat_all(splat.falloff), opacity = splat_all(splat.opacity);
  for (int x = 0; x < TILE_W; x += LANES) {
    const VFloat dx = load(frame.column + x) - splat.u;
    store(out.along + x, vexp2_minus(falloff * dx * dx));
  }
  for (int y = 0; y < TILE_H; y += LANES) {
    const VFloat dy = load(frame.row + y) - splat.v;
    store(out.down + y, opacity * vexp2_minus(falloff * dy * dy));
  }
  out.spot = splat;
  out.entry = entry;
  out.patches = patches_within(splat, frame) & open;
}

HGS_INLINE void trace(const DiscSplat& splat, TileEntry entry, const TileFrame& frame, std::uint32_t open,
                      DiscTrace& out) {
  out.spot = splat;
  out.entry = entry;
  out.patches = patches_within(splat, frame) & open;
}

// One vector of a patch: what a splat is there, before any clamping, and at what depth.
struct RoundFootprint {
  VFloat a, depth;
};

// ... and where the pixels are from (u, v), sheared (see DiscSpot).
struct DiscFootprint {
  VFloat a, depth, h, dy;
};

HGS_INLINE RoundFootprint footprint(const RoundTrace& trace, const TileFrame&, std::uint32_t patch, int part) {
  const float* along = trace.along + patch % PATCHES_X * EDGE;
  const float* down = trace.down + patch / PATCHES_X * EDGE;
  return {spread_columns(along) * spread_rows(down, part), splat_all(trace.spot.z)};
}

HGS_INLINE DiscFootprint footprint(const DiscTrace& trace, const TileFrame& frame, std::uint32_t patch, int part) {
  const DiscSpot& spot = trace.spot;
  const VFloat dx = lane_x() + (frame.left[patch] - spot.u);
  const VFloat dy = lane_y() + (frame.top[patch] + static_cast<float>(part * PART_ROWS) - spot.v);
  const VFloat h = dx - spot.lean * dy, exponent = spot.across * h * h + spot.down * dy * dy;
  return {spot.opacity * vexp2_minus(exponent), spot.z + spot.slope_h * h + spot.slope_y * dy, h, dy};
}

// min(a, MAX_ALPHA) where the splat counts, else 0.
HGS_INLINE VFloat masked_alpha(VFloat a, VFloat T) {
  const VMask counts = at_least(at_least(T, splat_all(MIN_TRANSMITTANCE)), a, splat_all(MIN_ALPHA));
  return where(counts, vmin(a, splat_all(MAX_ALPHA)));
}

}  // namespace hgs::HGS_VARIANT

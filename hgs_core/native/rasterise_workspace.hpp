// Scratch memory of one rasterisation. Kept between calls: the pages of fresh buffers would cost more than the
// work done in them.
#pragma once
#include <cstddef>
#include <cstdint>

#include "rasterise.hpp"
#include "scratch.hpp"

namespace hgs {

inline constexpr int TILE_W = 16;
inline constexpr int TILE_H = 16;
inline constexpr float HALF_LOG2_E = 0.72134752f;

// What a pixel has to know of an isotropic Gaussian.
struct alignas(32) RoundSpot {
  float u, v;     // [px]
  float falloff;  // log2(e) / (2 sigma^2): a = opacity * 2^(-falloff d^2)
  float opacity;
  float r, g, b;
  float z;        // [m]
};

// An isotropic Gaussian on the screen: one line of cache.
struct alignas(64) RoundSplat : RoundSpot {
  float reach;             // where a falls below 1/255 [px], rounded up
  float own_variance;      // (f r / z)^2 [px^2]
  std::uint32_t row;       // in the map
};

// The tiles that a splat touches: bit 4 * i + j of `mask` is tile (y + i, x + j). A splat that spans more than
// 4 x 4 tiles has mask 0 and is walked tile by tile.
struct TileSpan {
  std::uint32_t first_pair;  // its tiles are pairs first_pair .. first_pair + (number of its tiles)
  std::uint32_t depth_key;   // orders the splats by depth
  std::uint16_t x, y;
  std::uint16_t mask;
  std::uint16_t count;  // of the bits in mask
};
inline constexpr int SPAN = 4;

// Of a depth: steps of 4e-6 of the depth from the near plane to 6.5 km.
inline constexpr int DEPTH_KEY_BITS = 22;
inline constexpr int DEPTH_KEY_DROPPED = 5;  // low bits of the float

// A splat in a tile; `pair` numbers all pairs of a splat one after another.
struct TileEntry {
  std::uint32_t slot;
  std::uint32_t pair;
};

// What one round splat does to one tile, separated into columns and rows: a = along[x] down[y].
struct alignas(64) RoundTrace {
  float along[TILE_W];    // 2^(-falloff dx^2)
  float down[TILE_H];     // opacity 2^(-falloff dy^2)
  RoundSpot spot;
  TileEntry entry;
  std::uint32_t patches;  // bit i: the splat reaches patch i of the tile, which still let light through
};

// What a pixel has to know of a disc.
struct alignas(16) DiscSpot {
  float u, v;                // [px]
  // With h = dx - lean dy, d sheared so that Q becomes diagonal: a = opacity * 2^-(across h^2 + down dy^2). In Q's own
  // entries terms would cancel where a disc is long and thin.
  float across, lean, down;
  float opacity;
  float r, g, b;
  float z, slope_h, slope_y;  // depth [m], and how it grows with h and dy [m/px]
};

// A disc on the screen: one line of cache.
struct alignas(64) DiscSplat : DiscSpot {
  float decay;             // of the exponent, where a falls below 1/255; rounded up
  float reach_x, reach_y;  // how far that is from (u, v) at most [px], rounded up
  std::uint32_t row;       // in the map
};

// What one disc does to one tile: nothing about it separates.
struct alignas(64) DiscTrace {
  DiscSpot spot;
  TileEntry entry;
  std::uint32_t patches;
};

// The two kinds of Gaussians: how they lie in memory, and how many sums a second sweep makes of a (splat, tile) pair.
struct Isotropic {
  using Splat = RoundSplat;
  using Trace = RoundTrace;
  static constexpr int SUMS = 8;
};

struct Disc {
  using Splat = DiscSplat;
  using Trace = DiscTrace;
  static constexpr int SUMS = 16;
};

template <class Shape>
struct ShapeScratch {
  Scratch<typename Shape::Splat> splats;  // by slot
  Scratch<typename Shape::Trace> traces;  // (threads, most_entries): of the tile that a thread is at
};

struct Workspace : ShapeScratch<Isotropic>, ShapeScratch<Disc> {
  // Always inlined, as those of Scratch.
  template <class Shape>
  [[gnu::always_inline]] ShapeScratch<Shape>& of() { return *this; }
  template <class Shape>
  [[gnu::always_inline]] const ShapeScratch<Shape>& of() const { return *this; }

  // Splats lie in slots: slot = 256 * (index of the visible block) + rank within it.
  std::size_t n_visible_blocks = 0;
  std::size_t n_splats = 0;
  std::size_t n_pairs = 0;
  int tiles_x = 0, tiles_y = 0;
  std::uint32_t most_entries = 0;  // of any tile
  Scratch<std::uint32_t> visible_blocks;
  Scratch<std::uint32_t> block_splats;  // splats of each visible block
  Scratch<std::uint32_t> splats_before;  // prefix sums over the visible blocks
  Scratch<std::uint32_t> pairs_before;
  Scratch<float> tile_limits;       // (3, n_tiles), see TileLimits
  Scratch<TileSpan> spans;  // by slot
  Scratch<std::uint64_t> keys, keys_swap;  // (depth key << 32) | slot
  Scratch<std::uint32_t> histograms;
  Scratch<std::uint32_t> tile_begin;  // (n_tiles + 1)
  Scratch<TileEntry> entries;         // grouped by tile, front to back in each
  Scratch<float> pair_sums;           // (n_pairs, SUMS): what a second sweep adds up per pair
  Scratch<float> slot_coefficients;   // (slots, SUMS)
  Scratch<double> tile_losses;        // (n_tiles, 4)
  Scratch<double> thread_times;       // (threads,), of `stages`
  Scratch<float> bias_corrections;    // Adam's, by step: (steps, 2)
};

// Takes a workspace from a pool, gives it back at the end of the scope.
class WorkspaceLease {
 public:
  WorkspaceLease();
  ~WorkspaceLease();
  WorkspaceLease(const WorkspaceLease&) = delete;
  WorkspaceLease& operator=(const WorkspaceLease&) = delete;
  Workspace& operator*() const { return *workspace_; }

 private:
  Workspace* workspace_;
};

// Of every tile, the z-depth at and beyond which splats are hidden [m]: BEHIND_M behind its farthest depth. Nothing is
// hidden where a pixel of it was not measured, or where nothing is in range; nor are splats of more than SPAN x SPAN
// tiles, which hardly are there.
struct TileLimits {
  int tiles_x, tiles_y;
  const float* of_tile;
  const float *nearest, *farthest;  // of the SPAN x SPAN tiles from each on

  // Of a splat's tiles, see TileSpan, those where it is not hidden.
  [[gnu::always_inline]] int in_sight(int x, int y, int mask, float z) const {
    const int first = y * tiles_x + x;
    if (z < nearest[first]) return mask;
    if (z >= farthest[first]) return 0;
    int seen = 0;
    for (int bits = mask; bits != 0; bits &= bits - 1) {
      const int bit = __builtin_ctz(static_cast<unsigned>(bits));
      if (z < of_tile[first + bit / SPAN * tiles_x + bit % SPAN]) seen |= 1 << bit;
    }
    return seen;
  }

  // Whether everything at `z` and beyond is hidden in a part of the image [px].
  bool hide(float left, float top, float right, float bottom, float z) const;
};

// Of a depth image of the camera's size.
TileLimits tile_limits(const float* depth, const PinholeCamera& camera, Workspace& workspace);

// Fills `visible_blocks`: those whose bounds may reach into the image and are not hidden. `limits` may be null.
void cull_blocks(const GaussianRows& gaussians, const PinholeCamera& camera, const TileLimits* limits,
                 Workspace& workspace);

// Sorts the splats by depth and lists them by tile (`tile_begin`, `entries`). Needs `splats`, `spans`,
// `block_splats` and the number of tiles; sets `first_pair`.
template <class Shape>
void bin_splats(Workspace& workspace);

}  // namespace hgs

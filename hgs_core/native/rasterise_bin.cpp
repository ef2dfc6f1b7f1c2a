// One radix sort of all splats by depth, then one stable counting sort into tiles: every tile's list is front to
// back without a sort of its own, and the same for any number of threads.
//
// Wide splats are walked three times (numbered, counted, listed) by the same code; a fused multiply-add in one of
// these could round differently, so this file is compiled with -ffp-contract=off.
#include <omp.h>

#include <algorithm>
#include <bit>

#include "rasterise_workspace.hpp"

namespace hgs {
namespace {

constexpr int RADIX_BITS = DEPTH_KEY_BITS / 2;
constexpr int RADIX = 1 << RADIX_BITS;

constexpr int PREFETCH_AHEAD = 12;

// From (u, v): how far to the left and to the right a splat reaches, in some rows of pixels.
struct Chord {
  float left, right;
};

inline float reach_y_of(const RoundSplat& splat) { return splat.reach; }
inline float reach_y_of(const DiscSplat& splat) { return splat.reach_y; }

inline float within(float a, float low, float high) { return std::min(std::max(a, low), high); }

inline Chord chord_of(const RoundSplat& splat, float above, float below) {
  const float dy = std::max(std::max(above, -below), 0.0f);
  const float chord2 = splat.reach * splat.reach - dy * dy;
  const float chord = chord2 > 0.0f ? __builtin_sqrtf(chord2) : 0.0f;
  return {-chord, chord};
}

// The ellipse is widest to the right at `tilt`, to the left at -`tilt`; otherwise on the line of pixels next to there.
inline Chord chord_of(const DiscSplat& splat, float above, float below) {
  const float leant = splat.across * splat.lean;
  const float tilt = leant / (leant * splat.lean + splat.down) * splat.reach_x;
  const auto half = [&](float dy) {
    const float share = 1.0f - dy * dy / (splat.reach_y * splat.reach_y);
    return share > 0.0f ? __builtin_sqrtf(splat.decay / splat.across * share) : 0.0f;
  };
  const float at_right = within(tilt, above, below), at_left = within(-tilt, above, below);
  return {splat.lean * at_left - half(at_left), splat.lean * at_right + half(at_right)};
}

// Calls visit(tile) for every tile that the splat touches, row by row.
template <class Splat, class Visit>
inline void walk_tiles(const Splat& splat, int tiles_x, int tiles_y, Visit&& visit) {
  const float u = splat.u, v = splat.v, reach = reach_y_of(splat);
  // Compared in floats first: a splat next to the camera may reach beyond what an int holds. `reach` is rounded up
  // by more than "+ 1, then truncate" loses at whole numbers.
  const float top = (v - reach - (TILE_H - 0.5f)) * (1.0f / TILE_H) + 1.0f;
  const float bottom = (v + reach - 0.5f) * (1.0f / TILE_H);
  if (!(top < tiles_y) || !(bottom >= 0.0f)) return;
  const int first_y = top > 0.0f ? static_cast<int>(top) : 0;
  const int last_y = bottom < tiles_y - 1 ? static_cast<int>(bottom) : tiles_y - 1;
  for (int ty = first_y; ty <= last_y; ++ty) {
    const Chord chord = chord_of(splat, ty * TILE_H + 0.5f - v, ty * TILE_H + TILE_H - 0.5f - v);
    const float left = (u + chord.left - (TILE_W - 0.5f)) * (1.0f / TILE_W) + 1.0f;
    const float right = (u + chord.right - 0.5f) * (1.0f / TILE_W);
    if (!(left < tiles_x) || !(right >= 0.0f)) continue;
    const int first_x = left > 0.0f ? static_cast<int>(left) : 0;
    const int last_x = right < tiles_x - 1 ? static_cast<int>(right) : tiles_x - 1;
    for (int tx = first_x; tx <= last_x; ++tx) visit(ty * tiles_x + tx);
  }
}

template <class Splat, class Visit>
inline void for_each_tile(const TileSpan& span, const Splat& splat, int tiles_x, int tiles_y, Visit&& visit) {
  if (span.mask == 0) {
    walk_tiles(splat, tiles_x, tiles_y, visit);
    return;
  }
  const int corner = span.y * tiles_x + span.x;
  for (unsigned mask = span.mask; mask != 0; mask &= mask - 1) {
    const int bit = std::countr_zero(mask);
    visit(corner + (bit / SPAN) * tiles_x + bit % SPAN);
  }
}

struct Range {
  std::size_t begin, end;
};

inline Range share(std::size_t count, int thread, int threads) {
  return {count * thread / threads, count * (thread + 1) / threads};
}

// Numbers the pairs of each splat, and lists (depth, slot) of all splats.
template <class Shape>
void list_keys(Workspace& workspace) {
  const std::size_t n_blocks = workspace.n_visible_blocks;
  const int tiles_x = workspace.tiles_x, tiles_y = workspace.tiles_y;
  const std::uint32_t* block_splats = workspace.block_splats.get();
  std::uint32_t* splats_before = workspace.splats_before.require(n_blocks + 1);
  std::uint32_t* pairs_before = workspace.pairs_before.require(n_blocks + 1);
  const typename Shape::Splat* splats = workspace.of<Shape>().splats.get();
  TileSpan* spans = workspace.spans.get();
#pragma omp parallel for schedule(static)
  for (std::size_t i = 0; i < n_blocks; ++i) {
    std::uint32_t pairs = 0;
    for (std::uint32_t rank = 0; rank < block_splats[i]; ++rank) {
      const std::size_t slot = i * BLOCK + rank;
      spans[slot].first_pair = pairs;
      if (spans[slot].mask != 0) {
        pairs += spans[slot].count;
      } else {
        walk_tiles(splats[slot], tiles_x, tiles_y, [&](int) { ++pairs; });
      }
    }
    pairs_before[i + 1] = pairs;
  }
  splats_before[0] = pairs_before[0] = 0;
  for (std::size_t i = 0; i < n_blocks; ++i) {
    splats_before[i + 1] = splats_before[i] + block_splats[i];
    pairs_before[i + 1] += pairs_before[i];
  }
  workspace.n_splats = splats_before[n_blocks];
  workspace.n_pairs = pairs_before[n_blocks];
  std::uint64_t* keys = workspace.keys.require(workspace.n_splats);
  workspace.keys_swap.require(workspace.n_splats);
#pragma omp parallel for schedule(static)
  for (std::size_t i = 0; i < n_blocks; ++i) {
    for (std::uint32_t rank = 0; rank < block_splats[i]; ++rank) {
      const std::uint32_t slot = static_cast<std::uint32_t>(i * BLOCK + rank);
      spans[slot].first_pair += pairs_before[i];
      keys[splats_before[i] + rank] = (std::uint64_t{spans[slot].depth_key} << 32) | slot;
    }
  }
}

void sort_keys(Workspace& workspace) {
  const std::size_t n = workspace.n_splats;
  const int max_threads = omp_get_max_threads();
  std::uint32_t* histograms = workspace.histograms.require(std::size_t{RADIX} * max_threads);
  std::uint64_t* from = workspace.keys.get();
  std::uint64_t* to = workspace.keys_swap.get();
  for (int pass = 0; pass < 2; ++pass) {
    const int shift = 32 + pass * RADIX_BITS;
#pragma omp parallel
    {
      const int thread = omp_get_thread_num(), threads = omp_get_num_threads();
      const Range mine = share(n, thread, threads);
      std::uint32_t* histogram = histograms + std::size_t{RADIX} * thread;
      std::fill(histogram, histogram + RADIX, 0u);
      for (std::size_t i = mine.begin; i < mine.end; ++i) ++histogram[(from[i] >> shift) & (RADIX - 1)];
#pragma omp barrier
#pragma omp single
      {
        std::uint32_t sum = 0;
        for (int digit = 0; digit < RADIX; ++digit) {
          for (int t = 0; t < threads; ++t) {
            std::uint32_t& entry = histograms[std::size_t{RADIX} * t + digit];
            const std::uint32_t count = entry;
            entry = sum;
            sum += count;
          }
        }
      }
      for (std::size_t i = mine.begin; i < mine.end; ++i) {
        to[histogram[(from[i] >> shift) & (RADIX - 1)]++] = from[i];
      }
    }
    std::swap(from, to);
  }
}

template <class Shape>
void list_by_tile(Workspace& workspace) {
  const std::size_t n = workspace.n_splats;
  const int tiles_x = workspace.tiles_x, tiles_y = workspace.tiles_y;
  const std::size_t n_tiles = std::size_t{1} * tiles_x * tiles_y;
  const std::uint64_t* keys = workspace.keys.get();  // two passes: back where they started
  const typename Shape::Splat* splats = workspace.of<Shape>().splats.get();
  const TileSpan* spans = workspace.spans.get();
  std::uint32_t* tile_begin = workspace.tile_begin.require(n_tiles + 1);
  std::uint32_t* counts = workspace.histograms.require(n_tiles * omp_get_max_threads());
  TileEntry* entries = workspace.entries.require(workspace.n_pairs);
#pragma omp parallel
  {
    const int thread = omp_get_thread_num(), threads = omp_get_num_threads();
    const Range mine = share(n, thread, threads);
    std::uint32_t* next = counts + n_tiles * thread;
    std::fill(next, next + n_tiles, 0u);
    for (std::size_t i = mine.begin; i < mine.end; ++i) {
      __builtin_prefetch(&spans[static_cast<std::uint32_t>(keys[std::min(i + PREFETCH_AHEAD, n - 1)])]);
      const std::uint32_t slot = static_cast<std::uint32_t>(keys[i]);
      for_each_tile(spans[slot], splats[slot], tiles_x, tiles_y, [&](int tile) { ++next[tile]; });
    }
#pragma omp barrier
#pragma omp single
    {
      std::uint32_t sum = 0;
      workspace.most_entries = 0;
      for (std::size_t tile = 0; tile < n_tiles; ++tile) {
        tile_begin[tile] = sum;
        for (int t = 0; t < threads; ++t) {
          std::uint32_t& entry = counts[n_tiles * t + tile];
          const std::uint32_t count = entry;
          entry = sum;
          sum += count;
        }
        workspace.most_entries = std::max(workspace.most_entries, sum - tile_begin[tile]);
      }
      tile_begin[n_tiles] = sum;
    }
    for (std::size_t i = mine.begin; i < mine.end; ++i) {
      __builtin_prefetch(&spans[static_cast<std::uint32_t>(keys[std::min(i + PREFETCH_AHEAD, n - 1)])]);
      const std::uint32_t slot = static_cast<std::uint32_t>(keys[i]);
      std::uint32_t pair = spans[slot].first_pair;
      for_each_tile(spans[slot], splats[slot], tiles_x, tiles_y, [&](int tile) {
        TileEntry* entry = entries + next[tile]++;
        __builtin_prefetch(entry + 64 / sizeof(TileEntry), 1);  // the tile's next line of cache
        *entry = {slot, pair++};
      });
    }
  }
}

}  // namespace

template <class Shape>
void bin_splats(Workspace& workspace) {
  list_keys<Shape>(workspace);
  sort_keys(workspace);
  list_by_tile<Shape>(workspace);
}

template void bin_splats<Isotropic>(Workspace& workspace);
template void bin_splats<Disc>(Workspace& workspace);

}  // namespace hgs

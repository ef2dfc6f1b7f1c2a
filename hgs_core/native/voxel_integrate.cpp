// Rays into a log-odds voxel map.
//
// Each voxel is updated at most once a call: by `hit` when any ray ends in it with a return, else by `miss`
// when any ray passes it. Marks are collected first (idempotent stores, so that threads need no order and the
// result does not depend on their number), then applied in one sweep of the box that the rays span.
#include <algorithm>
#include <atomic>
#include <vector>

#include "voxel_kernels.hpp"

namespace hgs {
namespace {

enum : std::uint8_t { kUntouched = 0, kPassed = 1, kHit = 2 };

void mark(std::uint8_t& slot, std::uint8_t value) {
  std::atomic_ref<std::uint8_t>(slot).store(value, std::memory_order_relaxed);
}

}  // namespace

std::int64_t integrate_rays(const Grid& grid, std::uint8_t* states, float* log_odds, const Point& origin,
                            const double* ends, const std::uint8_t* is_hit, std::int64_t n_rays, const LogOdds& model,
                            const ChangedChunks& changed) {
  const auto end_of = [&](std::int64_t ray) { return Point{ends[3 * ray], ends[3 * ray + 1], ends[3 * ray + 2]}; };

  if (is_far(origin)) return 0;
  Cell low = cell_of(origin), high = low;
  for (std::int64_t ray = 0; ray < n_rays; ++ray) {
    if (is_far(end_of(ray))) continue;
    const Cell c = cell_of(end_of(ray));
    for (int a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], c[a]);
      high[a] = std::max(high[a], c[a]);
    }
  }
  Grid span;
  for (int a = 0; a < 3; ++a) {
    low[a] = std::max<std::int64_t>(low[a], 0);
    high[a] = std::min(high[a], grid.shape[a] - 1);
    if (low[a] > high[a]) return 0;
    span.shape[a] = high[a] - low[a] + 1;
  }
  const auto local = [&](const Cell& c) { return Cell{c[0] - low[0], c[1] - low[1], c[2] - low[2]}; };
  std::vector<std::uint8_t> marks(static_cast<std::size_t>(span.shape[0] * span.shape[1] * span.shape[2]), kUntouched);

#pragma omp parallel for schedule(dynamic, 256)
  for (std::int64_t ray = 0; ray < n_rays; ++ray) {
    const Point end = end_of(ray);
    double t_first, t_last;
    if (is_far(end) || !clip_to_grid(grid, origin, end, t_first, t_last)) continue;
    const Cell end_cell = cell_of(end);
    walk(grid, origin, end, t_first, t_last, [&](const Cell& cell, double, double) {
      // The voxel of a return is not passed by its own ray.
      if (is_hit[ray] && cell == end_cell) return false;
      mark(marks[span.offset(local(cell))], kPassed);
      return true;
    });
  }
  for (std::int64_t ray = 0; ray < n_rays; ++ray) {
    if (!is_hit[ray] || is_far(end_of(ray))) continue;
    const Cell c = cell_of(end_of(ray));
    if (grid.contains(c)) marks[span.offset(local(c))] = kHit;
  }

  std::int64_t n_new = 0;
#pragma omp parallel for schedule(static) reduction(+ : n_new)
  for (std::int64_t i = 0; i < span.shape[0]; ++i) {
    for (std::int64_t j = 0; j < span.shape[1]; ++j) {
      bool any_changed = false;
      const std::uint8_t* row = &marks[span.offset({i, j, 0})];
      const std::int64_t first = grid.offset({i + low[0], j + low[1], low[2]});
      for (std::int64_t k = 0; k < span.shape[2]; ++k) {
        if (row[k] == kUntouched) continue;
        const std::int64_t v = first + k;
        const float updated = log_odds[v] + (row[k] == kHit ? model.hit : model.miss);
        log_odds[v] = std::clamp(updated, model.lowest, model.highest);
        const std::uint8_t state = log_odds[v] > 0.0f ? kOccupied : kFree;
        n_new += states[v] == kUnobserved;
        any_changed |= states[v] != state;
        states[v] = state;
      }
      if (any_changed) changed.mark(i + low[0], j + low[1]);
    }
  }
  return n_new;
}

}  // namespace hgs

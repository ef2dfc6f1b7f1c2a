// Exact walk of a segment through a grid of unit cells (Amanatides & Woo, 1987).
//
// Coordinates are in cells: cell (i, j, k) is the half-open cube [i, i+1) x [j, j+1) x [k, k+1).
// The number of steps is fixed beforehand (the Manhattan distance between the first and the last cell), and
// an axis that has reached its last cell takes no further step: rounding cannot make a walk miss its end.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

namespace hgs {

using Point = std::array<double, 3>;
using Cell = std::array<std::int64_t, 3>;

struct Grid {
  Cell shape;
  std::int64_t offset(const Cell& c) const { return (c[0] * shape[1] + c[1]) * shape[2] + c[2]; }
  bool contains(const Cell& c) const {
    return c[0] >= 0 && c[0] < shape[0] && c[1] >= 0 && c[1] < shape[1] && c[2] >= 0 && c[2] < shape[2];
  }
};

// Coordinates beyond this, and those that are no numbers, lie in no grid.
inline constexpr double kFarthest = 1e12;
inline bool is_far(const Point& p) {
  return !(std::fabs(p[0]) < kFarthest && std::fabs(p[1]) < kFarthest && std::fabs(p[2]) < kFarthest);
}

inline Cell cell_of(const Point& p) {
  const auto whole = [](double x) {
    return static_cast<std::int64_t>(x < kFarthest ? (x > -kFarthest ? std::floor(x) : -kFarthest) : kFarthest);
  };
  return {whole(p[0]), whole(p[1]), whole(p[2])};
}

// The part [t_first, t_last] of the segment from + t * (to - from), 0 <= t <= 1, inside the grid's box.
// False when they do not meet.
inline bool clip_to_grid(const Grid& grid, const Point& from, const Point& to, double& t_first, double& t_last) {
  t_first = 0.0;
  t_last = 1.0;
  for (int a = 0; a < 3; ++a) {
    const double d = to[a] - from[a];
    const double high = static_cast<double>(grid.shape[a]);
    if (d == 0.0) {
      if (from[a] < 0.0 || from[a] >= high) return false;
      continue;
    }
    double enter = -from[a] / d, leave = (high - from[a]) / d;
    if (enter > leave) std::swap(enter, leave);
    t_first = std::max(t_first, enter);
    t_last = std::min(t_last, leave);
  }
  return t_first <= t_last;
}

// Calls visit(cell, t_enter, t_leave) for each cell that the part [t_first, t_last] crosses, in order, with
// t in units of (to - from); stops early when visit returns false. The part must lie inside the grid's box
// (cells are clamped to it, against rounding). Returns whether the walk came to its end.
template <class Visit>
inline bool walk(const Grid& grid, const Point& from, const Point& to, double t_first, double t_last, Visit&& visit) {
  Cell cell, last, step;
  Point t_next, t_cell;
  std::int64_t remaining = 0;
  for (int a = 0; a < 3; ++a) {
    const double d = to[a] - from[a];
    const auto clamp = [&](double x) {
      const auto i = static_cast<std::int64_t>(std::floor(x));
      return i < 0 ? std::int64_t{0} : (i >= grid.shape[a] ? grid.shape[a] - 1 : i);
    };
    cell[a] = clamp(from[a] + t_first * d);
    // t_last == 1 is the segment's own end: computed from `to` itself, so that rounding cannot move it.
    last[a] = clamp(t_last == 1.0 ? to[a] : from[a] + t_last * d);
    step[a] = d > 0 ? 1 : -1;
    if (d == 0.0 || (last[a] - cell[a]) * step[a] <= 0) {
      last[a] = cell[a];
      t_next[a] = std::numeric_limits<double>::infinity();
      t_cell[a] = 0.0;
    } else {
      t_cell[a] = 1.0 / std::fabs(d);
      t_next[a] = (static_cast<double>(cell[a] + (d > 0 ? 1 : 0)) - from[a]) / d;
      remaining += (last[a] - cell[a]) * step[a];
    }
  }
  double t_enter = t_first;
  for (;; --remaining) {
    const int a = t_next[0] <= t_next[1] ? (t_next[0] <= t_next[2] ? 0 : 2) : (t_next[1] <= t_next[2] ? 1 : 2);
    const double t_leave = remaining == 0 ? t_last : std::min(std::max(t_next[a], t_enter), t_last);
    if (!visit(cell, t_enter, t_leave)) return false;
    if (remaining == 0) return true;
    cell[a] += step[a];
    t_next[a] = cell[a] == last[a] ? std::numeric_limits<double>::infinity() : t_next[a] + t_cell[a];
    t_enter = t_leave;
  }
}

}  // namespace hgs

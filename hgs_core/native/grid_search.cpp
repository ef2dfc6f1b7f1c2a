// Shortest paths on a 2-D cost grid: 8-connected, no corner cutting.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

#include "grid_kernels.hpp"

namespace hgs {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kStepX[8] = {1, -1, 0, 0, 1, 1, -1, -1};
constexpr int kStepY[8] = {0, 0, 1, -1, 1, -1, 1, -1};
const double kStepLength[8] = {1.0, 1.0, 1.0, 1.0, std::sqrt(2.0), std::sqrt(2.0), std::sqrt(2.0), std::sqrt(2.0)};

using Entry = std::pair<double, int32_t>;  // (priority, cell): ties fall to the lower cell, so runs repeat
using Queue = std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>>;

inline bool passable(const CostGrid& grid, int x, int y) {
  if (x < 0 || y < 0 || x >= grid.nx || y >= grid.ny) return false;
  const float c = grid.cost[static_cast<size_t>(x) * grid.ny + y];
  return c > 0.0f && std::isfinite(c);
}

// Calls visit(neighbour, step cost) for each allowed step out of `cell`.
template <typename Visit>
inline void for_each_step(const CostGrid& grid, int32_t cell, const Visit& visit) {
  const int x = cell / grid.ny;
  const int y = cell % grid.ny;
  const double here = grid.cost[cell];
  for (int k = 0; k < 8; ++k) {
    const int u = x + kStepX[k];
    const int v = y + kStepY[k];
    if (!passable(grid, u, v)) continue;
    if (k >= 4 && (!passable(grid, u, y) || !passable(grid, x, v))) continue;
    const int32_t next = u * grid.ny + v;
    visit(next, kStepLength[k] * 0.5 * (here + grid.cost[next]));
  }
}

}  // namespace

void grid_dijkstra(const CostGrid& grid, const int32_t* seeds, const double* seed_costs, int n_seeds,
                   const int32_t* targets, int n_targets, double* distance, int32_t* parent) {
  const int32_t n_cells = grid.nx * grid.ny;
  std::fill(distance, distance + n_cells, kInfinity);
  std::fill(parent, parent + n_cells, -1);
  Queue queue;
  for (int s = 0; s < n_seeds; ++s) {
    const int32_t cell = seeds[s];
    if (!passable(grid, cell / grid.ny, cell % grid.ny) || seed_costs[s] >= distance[cell]) continue;
    distance[cell] = seed_costs[s];
    parent[cell] = cell;
    queue.emplace(seed_costs[s], cell);
  }
  std::vector<uint8_t> wanted;
  int left = 0;
  if (n_targets > 0) {
    wanted.assign(n_cells, 0);
    for (int t = 0; t < n_targets; ++t) {
      left += wanted[targets[t]] == 0;
      wanted[targets[t]] = 1;
    }
  }
  while (!queue.empty()) {
    const auto [d, cell] = queue.top();
    queue.pop();
    if (d > distance[cell]) continue;
    if (n_targets > 0 && wanted[cell]) {
      wanted[cell] = 0;
      if (--left == 0) break;
    }
    for_each_step(grid, cell, [&, base = d, from = cell](int32_t next, double step) {
      const double candidate = base + step;
      if (candidate < distance[next]) {
        distance[next] = candidate;
        parent[next] = from;
        queue.emplace(candidate, next);
      }
    });
  }
}

int grid_astar(const CostGrid& grid, int32_t start, int32_t goal, int32_t* path, double* length) {
  const int32_t n_cells = grid.nx * grid.ny;
  *length = kInfinity;
  if (!passable(grid, start / grid.ny, start % grid.ny) || !passable(grid, goal / grid.ny, goal % grid.ny)) return 0;
  double lowest = kInfinity;
  for (int32_t i = 0; i < n_cells; ++i) {
    const float c = grid.cost[i];
    if (c > 0.0f && c < lowest) lowest = c;
  }
  const int goal_x = goal / grid.ny;
  const int goal_y = goal % grid.ny;
  const auto heuristic = [&](int32_t cell) {
    const int dx = std::abs(cell / grid.ny - goal_x);
    const int dy = std::abs(cell % grid.ny - goal_y);
    return lowest * (std::max(dx, dy) + (std::sqrt(2.0) - 1.0) * std::min(dx, dy));
  };
  std::vector<double> distance(n_cells, kInfinity);
  std::vector<int32_t> parent(n_cells, -1);
  std::vector<uint8_t> closed(n_cells, 0);
  Queue queue;
  distance[start] = 0.0;
  queue.emplace(heuristic(start), start);
  while (!queue.empty()) {
    const int32_t cell = queue.top().second;
    queue.pop();
    if (closed[cell]) continue;
    closed[cell] = 1;
    if (cell == goal) break;
    for_each_step(grid, cell, [&](int32_t next, double step) {
      const double candidate = distance[cell] + step;
      if (!closed[next] && candidate < distance[next]) {
        distance[next] = candidate;
        parent[next] = cell;
        queue.emplace(candidate + heuristic(next), next);
      }
    });
  }
  if (!closed[goal]) return 0;
  *length = distance[goal];
  int n = 0;
  for (int32_t cell = goal; cell != -1; cell = parent[cell]) path[n++] = cell;
  std::reverse(path, path + n);
  return n;
}

void grid_pairwise(const CostGrid& grid, const int32_t* cells, int n, double* distance) {
  const size_t n_cells = static_cast<size_t>(grid.nx) * grid.ny;
#pragma omp parallel
  {
    std::vector<double> field(n_cells);
    std::vector<int32_t> parent(n_cells);
#pragma omp for schedule(dynamic, 1)
    for (int a = 0; a < n; ++a) {
      const double zero = 0.0;
      grid_dijkstra(grid, cells + a, &zero, 1, cells, n, field.data(), parent.data());
      for (int b = 0; b < n; ++b) distance[static_cast<size_t>(a) * n + b] = field[cells[b]];
    }
  }
}

}  // namespace hgs

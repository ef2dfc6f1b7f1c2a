// Shortest paths on a 2-D cost grid: 8-connected, no corner cutting.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <stdexcept>
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

namespace {

// Costs that differ by more need more buckets than there is memory for.
constexpr double kMostBuckets = 1e7;

// A grid with an impassable border of one cell, so that no step needs a test of its bounds; impassable cells cost 0.
struct PaddedGrid {
  int nx, ny;  // with the border
  float lowest = std::numeric_limits<float>::infinity(), highest = 0.0f;
  std::vector<float> cost;

  explicit PaddedGrid(const CostGrid& grid)
      : nx(grid.nx + 2), ny(grid.ny + 2), cost(static_cast<size_t>(nx) * static_cast<size_t>(ny), 0.0f) {
    for (int x = 0; x < grid.nx; ++x) {
      for (int y = 0; y < grid.ny; ++y) {
        const float c = grid.cost[static_cast<size_t>(x) * grid.ny + y];
        if (!(c > 0.0f && c < std::numeric_limits<float>::infinity())) continue;
        cost[static_cast<size_t>(cell(x, y))] = c;
        lowest = std::min(lowest, c);
        highest = std::max(highest, c);
      }
    }
    if (highest / lowest > kMostBuckets) throw std::invalid_argument("the costs of cells differ too much");
  }
  int32_t cell(int x, int y) const { return (x + 1) * ny + y + 1; }
  int32_t original(int32_t cell, const CostGrid& grid) const { return (cell / ny - 1) * grid.ny + cell % ny - 1; }

  // A field of cells (-1: none) without the border, and its cells numbered without it.
  std::vector<int32_t> unpadded(const std::vector<int32_t>& field, const CostGrid& grid) const {
    std::vector<int32_t> inside;
    inside.reserve(static_cast<size_t>(grid.nx) * grid.ny);
    for (int x = 0; x < grid.nx; ++x) {
      for (int y = 0; y < grid.ny; ++y) {
        const int32_t value = field[cell(x, y)];
        inside.push_back(value < 0 ? -1 : original(value, grid));
      }
    }
    return inside;
  }
};

// What a search knows of each cell. Clearing it costs what the search before touched.
struct SearchField {
  std::vector<double> distance;
  std::vector<int32_t> parent;
  std::vector<uint8_t> settled;

  void clear(size_t n_cells) {
    if (distance.size() != n_cells) {
      distance.assign(n_cells, kInfinity);
      parent.assign(n_cells, -1);
      settled.assign(n_cells, 0);
    } else {
      for (const int32_t cell : touched_) {
        distance[cell] = kInfinity;
        parent[cell] = -1;
        settled[cell] = 0;
      }
    }
    touched_.clear();
  }
  // To be called before a cell's distance is set.
  void touch(int32_t cell) {
    if (distance[cell] == kInfinity) touched_.push_back(cell);
  }

 private:
  std::vector<int32_t> touched_;
};

// Cells by distance, for steps of at least `width`: nothing that leaves the lowest bucket can return to it, so all
// that lies in it is final and its order does not matter (Dial, 1969).
class BucketQueue {
 public:
  BucketQueue(double width, double longest_step)
      : width_(width), buckets_(static_cast<size_t>(longest_step / width) + 3) {}

  void push(double distance, int32_t cell) {
    buckets_[static_cast<size_t>(distance / width_) % buckets_.size()].push_back(cell);
    ++size_;
  }
  // Moves on to the lowest bucket that holds anything; null when none does.
  std::vector<int32_t>* lowest() {
    if (size_ == 0) return nullptr;
    while (buckets_[at_ % buckets_.size()].empty()) ++at_;
    return &buckets_[at_ % buckets_.size()];
  }
  void clear(std::vector<int32_t>& bucket) {
    size_ -= bucket.size();
    bucket.clear();
  }

 private:
  double width_;
  std::vector<std::vector<int32_t>> buckets_;
  size_t size_ = 0, at_ = 0;
};

// Distances and parents over the padded grid. Stops once all of `n_wanted` (> 0) distinct wanted cells are settled.
// With `region`, which seed each cell is reached from (-1: none; the first of several seeds in one cell).
void search(const PaddedGrid& grid, const int32_t* seeds, const double* seed_costs, int n_seeds,
            const std::vector<uint8_t>& wanted, int n_wanted, SearchField& field,
            std::vector<int32_t>* region = nullptr) {
  constexpr double kRounding = 0.999;  // keeps a shortest step out of its own bucket
  std::vector<uint8_t>& settled = field.settled;
  std::vector<double>& distance = field.distance;
  std::vector<int32_t>& parent = field.parent;
  field.clear(grid.cost.size());
  double farthest_seed = 0.0;
  for (int s = 0; s < n_seeds; ++s) {
    if (seed_costs[s] < kInfinity) farthest_seed = std::max(farthest_seed, seed_costs[s]);
  }
  BucketQueue queue(kRounding * grid.lowest, std::sqrt(2.0) * grid.highest + farthest_seed);
  for (int s = 0; s < n_seeds; ++s) {
    const int32_t cell = seeds[s];
    if (grid.cost[cell] == 0.0f || seed_costs[s] >= distance[cell]) continue;
    field.touch(cell);
    distance[cell] = seed_costs[s];
    parent[cell] = cell;
    if (region) (*region)[cell] = s;
    queue.push(seed_costs[s], cell);
  }
  const int32_t dx = grid.ny;
  const int32_t straight[4] = {dx, -dx, 1, -1};
  const int32_t diagonal[4][3] = {{dx + 1, dx, 1}, {dx - 1, dx, -1}, {-dx + 1, -dx, 1}, {-dx - 1, -dx, -1}};
  const auto relax = [&](int32_t from, int32_t next, double length) {
    const double candidate = distance[from] + length * 0.5 * (static_cast<double>(grid.cost[from]) + grid.cost[next]);
    if (candidate >= distance[next]) return;
    field.touch(next);
    distance[next] = candidate;
    parent[next] = from;
    if (region) (*region)[next] = (*region)[from];
    queue.push(candidate, next);
  };
  while (std::vector<int32_t>* bucket = queue.lowest()) {
    for (size_t k = 0; k < bucket->size(); ++k) {
      const int32_t cell = (*bucket)[k];
      if (settled[cell]) continue;
      settled[cell] = 1;
      if (n_wanted > 0 && wanted[cell] && --n_wanted == 0) return;
      for (const int32_t step : straight) {
        if (grid.cost[cell + step] > 0.0f) relax(cell, cell + step, 1.0);
      }
      for (const int32_t* step : diagonal) {
        if (grid.cost[cell + step[0]] > 0.0f && grid.cost[cell + step[1]] > 0.0f && grid.cost[cell + step[2]] > 0.0f) {
          relax(cell, cell + step[0], std::sqrt(2.0));
        }
      }
    }
    queue.clear(*bucket);
  }
}

}  // namespace

void grid_dijkstra(const CostGrid& grid, const int32_t* seeds, const double* seed_costs, int n_seeds, double* distance,
                   int32_t* parent) {
  const PaddedGrid padded(grid);
  const auto inside = [&](int32_t cell) { return padded.cell(cell / grid.ny, cell % grid.ny); };
  std::vector<int32_t> padded_seeds;
  for (int s = 0; s < n_seeds; ++s) {
    // +inf: from there nothing is nearer
    if (!(seed_costs[s] >= 0.0) || (seed_costs[s] < kInfinity && seed_costs[s] / padded.lowest > kMostBuckets)) {
      throw std::invalid_argument("a seed's cost is negative, not a number or too great for the cells' costs");
    }
    padded_seeds.push_back(inside(seeds[s]));
  }
  SearchField field;
  search(padded, padded_seeds.data(), seed_costs, n_seeds, {}, 0, field);
  const std::vector<int32_t> parents = padded.unpadded(field.parent, grid);
  std::copy(parents.begin(), parents.end(), parent);
  for (int x = 0; x < grid.nx; ++x) {
    std::copy_n(&field.distance[static_cast<size_t>(padded.cell(x, 0))], grid.ny, distance + static_cast<size_t>(x) * grid.ny);
  }
}

void grid_ways(const CostGrid& grid, const int32_t* cells, int n, double* costs, int32_t* next, int32_t* crossings,
               int32_t* parent) {
  const PaddedGrid padded(grid);
  std::vector<int32_t> places;
  for (int a = 0; a < n; ++a) places.push_back(padded.cell(cells[a] / grid.ny, cells[a] % grid.ny));
  SearchField field;
  const std::vector<double>& distance = field.distance;
  std::vector<int32_t> region(padded.cost.size(), -1);
  const std::vector<double> zeros(static_cast<size_t>(n), 0.0);
  search(padded, places.data(), zeros.data(), n, {}, 0, field, &region);

  const auto at = [n](int a, int b) { return static_cast<size_t>(a) * n + b; };
  std::fill_n(costs, at(n, 0), kInfinity);
  std::fill_n(next, at(n, 0), -1);
  std::fill_n(crossings, at(n, 0), -1);
  const auto join = [&](int a, int b, double cost, int32_t cell_a, int32_t cell_b) {
    if (cost >= costs[at(a, b)]) return;
    costs[at(a, b)] = costs[at(b, a)] = cost;
    next[at(a, b)] = b;
    next[at(b, a)] = a;
    crossings[at(a, b)] = cell_a;
    crossings[at(b, a)] = cell_b;
  };
  const int32_t dx = padded.ny;
  const int32_t steps[4][3] = {{dx, 0, 0}, {1, 0, 0}, {dx + 1, dx, 1}, {dx - 1, dx, -1}};  // the cell, those beside
  for (int32_t cell = 0; cell < static_cast<int32_t>(padded.cost.size()); ++cell) {
    if (region[cell] < 0) continue;
    for (const int32_t* step : steps) {
      const int32_t other = cell + step[0];
      if (region[other] < 0 || region[other] == region[cell]) continue;
      const bool diagonal = step[1] != 0;
      if (diagonal && !(padded.cost[cell + step[1]] > 0.0f && padded.cost[cell + step[2]] > 0.0f)) continue;
      const double length = diagonal ? std::sqrt(2.0) : 1.0;
      const double across = length * 0.5 * (static_cast<double>(padded.cost[cell]) + padded.cost[other]);
      join(region[cell], region[other], distance[cell] + across + distance[other], padded.original(cell, grid),
           padded.original(other, grid));
    }
  }
  for (int a = 0; a < n; ++a) {
    const int owner = region[places[a]];
    if (owner < 0) continue;
    costs[at(a, a)] = 0.0;
    next[at(a, a)] = a;
    if (owner != a) join(owner, a, 0.0, cells[a], cells[a]);
  }
  for (int via = 0; via < n; ++via)  // Floyd and Warshall
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b) {
        const double cost = costs[at(a, via)] + costs[at(via, b)];
        if (cost >= costs[at(a, b)]) continue;
        costs[at(a, b)] = cost;
        next[at(a, b)] = next[at(a, via)];
      }
  const std::vector<int32_t> parents = padded.unpadded(field.parent, grid);
  std::copy(parents.begin(), parents.end(), parent);
}

int grid_astar(const CostGrid& grid, int32_t start, int32_t goal, int32_t* path, double* length) {
  const int32_t n_cells = grid.nx * grid.ny;
  *length = kInfinity;
  if (!passable(grid, start / grid.ny, start % grid.ny) || !passable(grid, goal / grid.ny, goal % grid.ny)) return 0;
  float least = std::numeric_limits<float>::infinity();
  for (int32_t i = 0; i < n_cells; ++i) least = std::min(least, grid.cost[i] > 0.0f ? grid.cost[i] : least);
  const double lowest = least;
  const int goal_x = goal / grid.ny;
  const int goal_y = goal % grid.ny;
  const auto heuristic = [&](int32_t cell) {
    const int dx = std::abs(cell / grid.ny - goal_x);
    const int dy = std::abs(cell % grid.ny - goal_y);
    return lowest * (std::max(dx, dy) + (std::sqrt(2.0) - 1.0) * std::min(dx, dy));
  };
  thread_local SearchField field;  // kept: a short search shall not pay for the whole grid
  field.clear(static_cast<size_t>(n_cells));
  std::vector<double>& distance = field.distance;
  std::vector<int32_t>& parent = field.parent;
  std::vector<uint8_t>& closed = field.settled;
  Queue queue;
  field.touch(start);
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
        field.touch(next);
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
  const PaddedGrid padded(grid);
  std::vector<int32_t> places;
  for (int a = 0; a < n; ++a) places.push_back(padded.cell(cells[a] / grid.ny, cells[a] % grid.ny));
#pragma omp parallel
  {
    SearchField field;
    std::vector<uint8_t> wanted(padded.cost.size(), 0);
#pragma omp for schedule(dynamic, 1)
    for (int a = 0; a < n; ++a) {  // costs are the same both ways: each search looks for those after it
      int n_wanted = 0;
      for (int b = a; b < n; ++b) {
        n_wanted += wanted[places[b]] == 0;
        wanted[places[b]] = 1;
      }
      const double zero = 0.0;
      search(padded, &places[a], &zero, 1, wanted, n_wanted, field);
      for (int b = a; b < n; ++b) {
        wanted[places[b]] = 0;
        distance[static_cast<size_t>(a) * n + b] = distance[static_cast<size_t>(b) * n + a] = field.distance[places[b]];
      }
    }
  }
}

}  // namespace hgs

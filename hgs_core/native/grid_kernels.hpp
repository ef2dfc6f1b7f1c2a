// Kernels over a 2-D grid: shortest paths, clearance to cell boxes, open tours. Plain arrays, no Python.
//
// A grid has nx rows and ny columns, cell (i, j) at index i * ny + j covers [i, i+1) x [j, j+1); all lengths
// are in cells. Everything outside the grid counts as blocked.
#pragma once
#include <cstdint>

namespace hgs {

// Costs per unit length: positive and finite = passable; anything else = impassable.
struct CostGrid {
  const float* cost;
  int nx;
  int ny;
};

// One-to-all Dijkstra from `n_seeds` cells with initial costs. 8-connected; a step costs its length times the
// mean cost of its two cells; a diagonal step needs both cells beside it passable. `distance` is +inf and
// `parent` -1 where unreached; a seed is its own parent.
void grid_dijkstra(const CostGrid& grid, const int32_t* seeds, const double* seed_costs, int n_seeds, double* distance,
                   int32_t* parent);

// Point-to-point A* under the same rules; the heuristic is the octile distance times the lowest cost.
// Writes the cells from start to goal to `path` (room for nx * ny) and returns their number, 0 if none.
int grid_astar(const CostGrid& grid, int32_t start, int32_t goal, int32_t* path, double* length);

// distance[a * n + b] between every two of `n` cells (OpenMP over the sources).
void grid_pairwise(const CostGrid& grid, const int32_t* cells, int n, double* distance);

// Ways between `n` cells by one search from all of them at once. Each cell of the grid belongs to the region of the
// terminal that is nearest to it; where two regions meet, the best way across joins their terminals, exact unless a
// shorter one leads through a third region. Other terminals are joined by way of those between them.
//
// costs[a * n + b]: of the way from a to b, +inf without one; next[a * n + b]: the terminal after a on it (a itself
// for a = b, -1 without one); crossings[a * n + b], for neighbours: the last cell of the way that lies in a's region;
// parent (nx * ny): the cell before towards the terminal, its own for a terminal, -1 where none is reached.
void grid_ways(const CostGrid& grid, const int32_t* cells, int n, double* costs, int32_t* next, int32_t* crossings,
               int32_t* parent);

// How many of the flagged cells have their centres at most `radius` from each point.
void grid_count_in_discs(const uint8_t* flags, int nx, int ny, const double* points, int n_points, double radius,
                         int64_t* counts);

// Distance from each cell's centre to the nearest blocked cell's box (or the grid's border), at most `cap`;
// 0 in blocked cells.
void grid_box_clearance(const uint8_t* blocked, int nx, int ny, float cap, float* clearance);

// A floor plan: which cells are blocked, grid_box_clearance's result for it, and the cost per unit length.
struct FloorGrid {
  const uint8_t* blocked;
  const float* clearance;
  const float* soft_cost;
  int nx;
  int ny;
};

// For each segment (x0, y0, x1, y1): the least distance to a blocked box (at most `cap`, the one of `clearance`) and
// the integral of `soft_cost`, sampled every `step` or less, both ends included.
void grid_segments(const FloorGrid& floor, const double* segments, int n_segments, double step, double cap,
                   double* least_clearance, double* cost);

// Replaces runs of a polyline by straight lines, from its start always the longest run that a line may replace: the
// line keeps `wanted_clearance`, or what the run itself keeps where that is less, and costs at most `cost_factor`
// times as much. Writes the indices of the points that are left (room for n_points) and returns their number.
int grid_straighten(const FloorGrid& floor, const double* points, int n_points, double step, double cap,
                    double wanted_clearance, double cost_factor, int32_t* kept);

// Darts thrown at points in the given order: indices of those at least `spacing` from each other and from the taken
// ones, at most `limit` (room for that many). Returns their number.
int throw_darts(const double* points, const int64_t* order, int n_points, const double* taken, int n_taken,
                double spacing, int limit, int64_t* chosen);

// Shortest open tour through n nodes that begins at node 0 and, when `fixed_end` >= 0, ends there. `cost` is
// n x n, may be asymmetric. Exact (Held-Karp) up to 11 further nodes, else multi-start 2-opt and Or-opt.
double open_tour(const double* cost, int n, int fixed_end, int32_t* order);

// Improves an order of the places 1 .. n_all - 1, begun from place 0: one place moved elsewhere or a stretch reversed,
// the best of all such moves at a time, until none makes `sum_k weights[k] arrival[k] + whole_way last_arrival` less.
// Returns that.
double improve_latency(const double* cost, const double* weights, int n_all, double whole_way, int max_sweeps,
                       int32_t* order);

}  // namespace hgs

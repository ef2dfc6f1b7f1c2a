// Shortest open tours over a small, possibly asymmetric cost matrix.
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "grid_kernels.hpp"

namespace hgs {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kExactNodes = 11;
constexpr double kGain = 1e-9;  // an improvement must exceed rounding, or the search could cycle

struct Matrix {
  const double* cost;
  int n;
  double operator()(int a, int b) const { return cost[static_cast<size_t>(a) * n + b]; }
};

double tour_cost(const Matrix& c, const std::vector<int>& tour) {
  double total = 0.0;
  for (size_t k = 1; k < tour.size(); ++k) total += c(tour[k - 1], tour[k]);
  return total;
}

// Held-Karp: best[set][last] over the free nodes; the fixed end is charged at the close.
std::vector<int> exact(const Matrix& c, const std::vector<int>& free_nodes, int fixed_end) {
  const int m = static_cast<int>(free_nodes.size());
  const int n_sets = 1 << m;
  std::vector<double> best(static_cast<size_t>(n_sets) * m, kInfinity);
  std::vector<int> before(static_cast<size_t>(n_sets) * m, -1);
  for (int a = 0; a < m; ++a) best[static_cast<size_t>(1 << a) * m + a] = c(0, free_nodes[a]);
  for (int set = 1; set < n_sets; ++set)
    for (int last = 0; last < m; ++last) {
      const double here = best[static_cast<size_t>(set) * m + last];
      if (!(set >> last & 1) || here == kInfinity) continue;
      for (int next = 0; next < m; ++next) {
        if (set >> next & 1) continue;
        const size_t to = static_cast<size_t>(set | 1 << next) * m + next;
        const double candidate = here + c(free_nodes[last], free_nodes[next]);
        if (candidate < best[to]) {
          best[to] = candidate;
          before[to] = last;
        }
      }
    }
  std::vector<int> tour{0};
  if (m > 0) {
    int last = 0;
    double least = kInfinity;
    for (int a = 0; a < m; ++a) {
      const double total =
          best[static_cast<size_t>(n_sets - 1) * m + a] + (fixed_end >= 0 ? c(free_nodes[a], fixed_end) : 0.0);
      if (total < least) {
        least = total;
        last = a;
      }
    }
    std::vector<int> reversed;
    for (int set = n_sets - 1, a = last; a != -1;) {
      reversed.push_back(free_nodes[a]);
      const int previous = before[static_cast<size_t>(set) * m + a];
      set ^= 1 << a;
      a = previous;
    }
    tour.insert(tour.end(), reversed.rbegin(), reversed.rend());
  }
  if (fixed_end >= 0) tour.push_back(fixed_end);
  return tour;
}

// Moves every segment of up to three nodes, either way round, and reverses every segment, until nothing helps.
void improve(const Matrix& c, std::vector<int>& tour, bool end_is_fixed) {
  const int last_movable = static_cast<int>(tour.size()) - (end_is_fixed ? 2 : 1);
  double current = tour_cost(c, tour);
  std::vector<int> trial;
  bool improved = true;
  const auto accept = [&]() {
    const double cost = tour_cost(c, trial);
    if (cost < current - kGain) {
      tour = trial;
      current = cost;
      improved = true;
    }
  };
  while (improved) {
    improved = false;
    for (int i = 1; i <= last_movable; ++i)
      for (int j = i + 1; j <= last_movable; ++j) {
        trial = tour;
        std::reverse(trial.begin() + i, trial.begin() + j + 1);
        accept();
      }
    for (int length = 1; length <= 3; ++length)
      for (int i = 1; i + length - 1 <= last_movable; ++i)
        for (int target = 1; target + length - 1 <= last_movable; ++target) {
          if (target == i) continue;
          for (int flipped = 0; flipped < (length > 1 ? 2 : 1); ++flipped) {
            trial = tour;
            std::vector<int> segment(trial.begin() + i, trial.begin() + i + length);
            trial.erase(trial.begin() + i, trial.begin() + i + length);
            if (flipped) std::reverse(segment.begin(), segment.end());
            trial.insert(trial.begin() + target, segment.begin(), segment.end());
            accept();
          }
        }
  }
}

// Nearest neighbour after a given first step.
std::vector<int> nearest_neighbour(const Matrix& c, std::vector<int> free_nodes, int first, int fixed_end) {
  std::vector<int> tour{0};
  int next = first;
  while (!free_nodes.empty()) {
    tour.push_back(free_nodes[next]);
    free_nodes.erase(free_nodes.begin() + next);
    next = 0;
    for (size_t k = 1; k < free_nodes.size(); ++k)
      if (c(tour.back(), free_nodes[k]) < c(tour.back(), free_nodes[next])) next = static_cast<int>(k);
  }
  if (fixed_end >= 0) tour.push_back(fixed_end);
  return tour;
}

}  // namespace

double open_tour(const double* cost, int n, int fixed_end, int32_t* order) {
  const Matrix c{cost, n};
  std::vector<int> free_nodes;
  for (int a = 1; a < n; ++a)
    if (a != fixed_end) free_nodes.push_back(a);
  std::vector<int> best;
  if (static_cast<int>(free_nodes.size()) <= kExactNodes) {
    best = exact(c, free_nodes, fixed_end);
  } else {
    // Starts from the six cheapest first steps: more starts gain under a percent and cost in proportion.
    std::vector<int> firsts(free_nodes.size());
    for (size_t k = 0; k < firsts.size(); ++k) firsts[k] = static_cast<int>(k);
    std::stable_sort(firsts.begin(), firsts.end(),
                     [&](int a, int b) { return c(0, free_nodes[a]) < c(0, free_nodes[b]); });
    double least = kInfinity;
    for (size_t k = 0; k < std::min<size_t>(6, firsts.size()); ++k) {
      std::vector<int> tour = nearest_neighbour(c, free_nodes, firsts[k], fixed_end);
      improve(c, tour, fixed_end >= 0);
      const double total = tour_cost(c, tour);
      if (total < least - kGain) {
        least = total;
        best = tour;
      }
    }
  }
  for (int k = 0; k < n; ++k) order[k] = best[k];
  return tour_cost(c, best);
}

}  // namespace hgs

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
constexpr double kShare = 1e-12;  // of the greatest cost: so must it among great costs

struct Matrix {
  const double* cost;
  int n;
  double gain;  // the least that counts
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

// Sums of the steps along a tour, forwards and backwards: what a run costs either way round, at once.
class StepSums {
 public:
  StepSums(const Matrix& c, const std::vector<int>& tour) : forward_(tour.size(), 0.0), backward_(tour.size(), 0.0) {
    for (size_t k = 1; k < tour.size(); ++k) {
      forward_[k] = forward_[k - 1] + c(tour[k - 1], tour[k]);
      backward_[k] = backward_[k - 1] + c(tour[k], tour[k - 1]);
    }
  }
  double forward(int first, int last) const { return forward_[last] - forward_[first]; }
  double backward(int first, int last) const { return backward_[last] - backward_[first]; }

 private:
  std::vector<double> forward_, backward_;
};

// Moves every segment of up to three nodes, either way round, and reverses every segment, until nothing helps. What a
// move would gain follows from the few steps that it changes.
void improve(const Matrix& c, std::vector<int>& tour, bool end_is_fixed) {
  const int last = static_cast<int>(tour.size()) - 1;
  const int last_movable = end_is_fixed ? last - 1 : last;
  StepSums sums(c, tour);
  bool improved = true;
  // The step from position k to a node, or to none behind the tour's end.
  const auto step_on = [&](int from, int k) { return k <= last ? c(from, tour[k]) : 0.0; };
  const auto accept = [&]() {
    sums = StepSums(c, tour);
    improved = true;
  };
  while (improved) {
    improved = false;
    for (int i = 1; i <= last_movable; ++i)
      for (int j = i + 1; j <= last_movable; ++j) {
        const double before = c(tour[i - 1], tour[i]) + sums.forward(i, j) + step_on(tour[j], j + 1);
        const double after = c(tour[i - 1], tour[j]) + sums.backward(i, j) + step_on(tour[i], j + 1);
        if (after >= before - c.gain) continue;
        std::reverse(tour.begin() + i, tour.begin() + j + 1);
        accept();
      }
    for (int length = 1; length <= 3; ++length)
      for (int i = 1; i + length - 1 <= last_movable; ++i)
        for (int target = 1; target + length - 1 <= last_movable; ++target) {
          if (target == i) continue;
          const int end = i + length - 1;
          // The segment leaves its place and goes between positions `left` and `left + 1`.
          const int left = target < i ? target - 1 : target + length - 1;
          const double closed = step_on(tour[i - 1], end + 1);
          const double opened = step_on(tour[left], left + 1);
          const double before = c(tour[i - 1], tour[i]) + step_on(tour[end], end + 1) + opened;
          for (int flipped = 0; flipped < (length > 1 ? 2 : 1); ++flipped) {
            const int first = flipped ? tour[end] : tour[i], final = flipped ? tour[i] : tour[end];
            const double turned = flipped ? sums.backward(i, end) - sums.forward(i, end) : 0.0;
            const double after = closed + c(tour[left], first) + step_on(final, left + 1) + turned;
            if (after >= before - c.gain) continue;
            if (flipped) std::reverse(tour.begin() + i, tour.begin() + end + 1);
            if (target < i) {
              std::rotate(tour.begin() + target, tour.begin() + i, tour.begin() + end + 1);
            } else {
              std::rotate(tour.begin() + i, tour.begin() + end + 1, tour.begin() + left + 1);
            }
            accept();
            break;
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
  double dearest = 0.0;
  for (size_t k = 0; k < static_cast<size_t>(n) * n; ++k) dearest = std::max(dearest, std::abs(cost[k]));
  const Matrix c{cost, n, std::max(kGain, kShare * dearest)};
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

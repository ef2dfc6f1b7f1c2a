// An order of visits that makes arrivals early: local search for the weighted latency of a path.
#include <algorithm>
#include <vector>

#include "grid_kernels.hpp"

namespace hgs {
namespace {

constexpr double kGain = 1e-9;  // relative: an improvement must exceed rounding, or the search could cycle

struct Latency {
  const double *cost, *weights;
  int n_all;
  double whole_way;

  double operator()(const std::vector<int32_t>& order) const {
    double arrival = 0.0, total = 0.0;
    int32_t at = 0;
    for (const int32_t place : order) {
      arrival += cost[static_cast<size_t>(at) * n_all + place];
      total += weights[place] * arrival;
      at = place;
    }
    return total + whole_way * arrival;
  }
};

}  // namespace

double improve_latency(const double* cost, const double* weights, int n_all, double whole_way, int max_sweeps,
                       int32_t* order) {
  const Latency latency{cost, weights, n_all, whole_way};
  std::vector<int32_t> now(order, order + n_all - 1), best = now, tried;
  const int n = n_all - 1;
  double least = latency(now);
  for (int sweep = 0; sweep < max_sweeps; ++sweep) {
    const double before = least;
    const auto consider = [&] {
      const double value = latency(tried);
      if (value < least - kGain * before) {
        least = value;
        best = tried;
      }
    };
    for (int a = 0; a < n; ++a) {
      for (int b = 0; b < n; ++b) {
        if (a == b) continue;
        tried = now;
        const auto first = tried.begin();
        if (a < b) {
          std::rotate(first + a, first + a + 1, first + b + 1);
          consider();
          if (b > a + 1) {
            tried = now;
            std::reverse(tried.begin() + a, tried.begin() + b + 1);
            consider();
          }
        } else {
          std::rotate(first + b, first + a, first + a + 1);
          consider();
        }
      }
    }
    if (least >= before) break;
    now = best;
  }
  std::copy(now.begin(), now.end(), order);
  return least;
}

}  // namespace hgs

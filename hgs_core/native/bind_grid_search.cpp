#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <tuple>
#include <vector>

#include "bind.hpp"
#include "grid_kernels.hpp"

namespace nb = nanobind;

namespace {

void check_cells(const int32_t* cells, size_t n, size_t n_cells) {
  for (size_t k = 0; k < n; ++k)
    if (cells[k] < 0 || static_cast<size_t>(cells[k]) >= n_cells) throw std::out_of_range("cell outside the grid");
}

hgs::CostGrid view(const Grid<float>& cost) {
  return {cost.data(), static_cast<int>(cost.shape(0)), static_cast<int>(cost.shape(1))};
}

void check_same_shape(size_t nx, size_t ny, size_t mx, size_t my) {
  if (nx != mx || ny != my) throw std::invalid_argument("grids differ in shape");
}

hgs::FloorGrid floor_of(const Grid<uint8_t>& blocked, const Grid<float>& clearance, const Grid<float>& soft_cost) {
  check_same_shape(blocked.shape(0), blocked.shape(1), clearance.shape(0), clearance.shape(1));
  check_same_shape(blocked.shape(0), blocked.shape(1), soft_cost.shape(0), soft_cost.shape(1));
  return {blocked.data(), clearance.data(), soft_cost.data(), static_cast<int>(blocked.shape(0)),
          static_cast<int>(blocked.shape(1))};
}

// A sample every `step` of a straight line between any two of the points.
void check_samples(const double* coordinates, size_t n, double step, double cap) {
  constexpr double kMostSamples = 1e7;
  if (!(step > 0.0) || !(cap >= 0.0)) throw std::invalid_argument("the step must be positive, the cap not negative");
  double farthest = 0.0;
  for (size_t k = 0; k < n; ++k) {
    if (!std::isfinite(coordinates[k])) throw std::invalid_argument("a point is not finite");
    farthest = std::max(farthest, std::abs(coordinates[k]));
  }
  if (farthest / step > kMostSamples) throw std::invalid_argument("a point lies too far off for so small a step");
}

}  // namespace

void bind_grid_search(nb::module_& m) {
  m.def(
      "grid_dijkstra",
      [](Grid<float> cost, Vector<int32_t> seeds, Vector<double> seed_costs) {
        const size_t shape[2] = {cost.shape(0), cost.shape(1)};
        const size_t n_cells = shape[0] * shape[1];
        check_cells(seeds.data(), seeds.shape(0), n_cells);
        if (seeds.shape(0) != seed_costs.shape(0)) throw std::invalid_argument("one cost a seed");
        auto distance = std::make_unique<double[]>(n_cells);
        auto parent = std::make_unique<int32_t[]>(n_cells);
        {
          nb::gil_scoped_release release;
          hgs::grid_dijkstra(view(cost), seeds.data(), seed_costs.data(), static_cast<int>(seeds.shape(0)),
                             distance.get(), parent.get());
        }
        return std::make_tuple(owned(std::move(distance), shape), owned(std::move(parent), shape));
      },
      nb::arg("cost"), nb::arg("seeds"), nb::arg("seed_costs"),
      "Distances and parents of all cells from the seeds (flat cell indices).");

  m.def(
      "grid_astar",
      [](Grid<float> cost, int32_t start, int32_t goal) {
        const size_t n_cells = cost.shape(0) * cost.shape(1);
        check_cells(&start, 1, n_cells);
        check_cells(&goal, 1, n_cells);
        auto path = std::make_unique<int32_t[]>(n_cells);
        double length = 0.0;
        int n = 0;
        {
          nb::gil_scoped_release release;
          n = hgs::grid_astar(view(cost), start, goal, path.get(), &length);
        }
        const size_t shape[1] = {static_cast<size_t>(n)};
        return std::make_tuple(owned(std::move(path), shape), length);
      },
      nb::arg("cost"), nb::arg("start"), nb::arg("goal"),
      "Cells from start to goal (empty: no way) and the cost of the way.");

  m.def(
      "grid_pairwise",
      [](Grid<float> cost, Vector<int32_t> cells) {
        const size_t n = cells.shape(0);
        check_cells(cells.data(), n, cost.shape(0) * cost.shape(1));
        const size_t shape[2] = {n, n};
        auto distance = std::make_unique<double[]>(n * n);
        {
          nb::gil_scoped_release release;
          hgs::grid_pairwise(view(cost), cells.data(), static_cast<int>(n), distance.get());
        }
        return owned(std::move(distance), shape);
      },
      nb::arg("cost"), nb::arg("cells"), "Path costs between every two cells, +inf where there is no way.");

  m.def(
      "grid_ways",
      [](Grid<float> cost, Vector<int32_t> cells) {
        const size_t n = cells.shape(0), n_cells = cost.shape(0) * cost.shape(1);
        check_cells(cells.data(), n, n_cells);
        auto costs = std::make_unique<double[]>(n * n);
        auto next = std::make_unique<int32_t[]>(n * n), crossings = std::make_unique<int32_t[]>(n * n);
        auto parent = std::make_unique<int32_t[]>(n_cells);
        {
          nb::gil_scoped_release release;
          hgs::grid_ways(view(cost), cells.data(), static_cast<int>(n), costs.get(), next.get(), crossings.get(),
                         parent.get());
        }
        return std::make_tuple(owned(std::move(costs), {n, n}), owned(std::move(next), {n, n}),
                               owned(std::move(crossings), {n, n}), owned(std::move(parent), {n_cells}));
      },
      nb::arg("cost"), nb::arg("cells"),
      "Ways between cells: costs, the next cell on each way, where it leaves a cell's region, and all parents.");

  m.def(
      "grid_count_in_discs",
      [](Grid<uint8_t> flags, Grid<double> points, double radius) {
        if (points.shape(1) != 2) throw std::invalid_argument("a point is x, y");
        const size_t n = points.shape(0);
        auto counts = std::make_unique<int64_t[]>(n);
        {
          nb::gil_scoped_release release;
          hgs::grid_count_in_discs(flags.data(), static_cast<int>(flags.shape(0)), static_cast<int>(flags.shape(1)),
                                   points.data(), static_cast<int>(n), radius, counts.get());
        }
        return owned(std::move(counts), {n});
      },
      nb::arg("flags"), nb::arg("points"), nb::arg("radius"),
      "How many flagged cells have their centres within a radius [cells] of each point [cells].");

  m.def(
      "grid_box_clearance",
      [](Grid<uint8_t> blocked, float cap) {
        if (!(cap >= 0.0f)) throw std::invalid_argument("the cap must not be negative");
        const size_t shape[2] = {blocked.shape(0), blocked.shape(1)};
        auto clearance = std::make_unique<float[]>(shape[0] * shape[1]);
        {
          nb::gil_scoped_release release;
          hgs::grid_box_clearance(blocked.data(), static_cast<int>(shape[0]), static_cast<int>(shape[1]), cap,
                                  clearance.get());
        }
        return owned(std::move(clearance), shape);
      },
      nb::arg("blocked"), nb::arg("cap"), "Distance [cells] of cell centres to the nearest blocked box, capped.");

  m.def(
      "grid_segments",
      [](Grid<uint8_t> blocked, Grid<float> clearance, Grid<float> soft_cost, Grid<double> segments, double step,
         double cap) {
        const hgs::FloorGrid floor = floor_of(blocked, clearance, soft_cost);
        if (segments.shape(1) != 4) throw std::invalid_argument("a segment is x0, y0, x1, y1");
        check_samples(segments.data(), segments.shape(0) * 4, step, cap);
        const size_t shape[1] = {segments.shape(0)};
        auto least = std::make_unique<double[]>(shape[0]);
        auto cost = std::make_unique<double[]>(shape[0]);
        {
          nb::gil_scoped_release release;
          hgs::grid_segments(floor, segments.data(), static_cast<int>(shape[0]), step, cap, least.get(), cost.get());
        }
        return std::make_tuple(owned(std::move(least), shape), owned(std::move(cost), shape));
      },
      nb::arg("blocked"), nb::arg("clearance"), nb::arg("soft_cost"), nb::arg("segments"), nb::arg("step"),
      nb::arg("cap"), "Least clearance and cost integral of straight segments [cells].");

  m.def(
      "grid_straighten",
      [](Grid<uint8_t> blocked, Grid<float> clearance, Grid<float> soft_cost, Grid<double> points, double step,
         double cap, double wanted_clearance, double cost_factor) {
        const hgs::FloorGrid floor = floor_of(blocked, clearance, soft_cost);
        if (points.shape(1) != 2) throw std::invalid_argument("a point is x, y");
        check_samples(points.data(), points.shape(0) * 2, step, cap);
        const size_t n = points.shape(0);
        auto kept = std::make_unique<int32_t[]>(n);
        size_t n_kept = 0;
        {
          nb::gil_scoped_release release;
          n_kept = static_cast<size_t>(hgs::grid_straighten(floor, points.data(), static_cast<int>(n), step, cap,
                                                            wanted_clearance, cost_factor, kept.get()));
        }
        return owned(std::move(kept), {n_kept});
      },
      nb::arg("blocked"), nb::arg("clearance"), nb::arg("soft_cost"), nb::arg("points"), nb::arg("step"),
      nb::arg("cap"), nb::arg("wanted_clearance"), nb::arg("cost_factor"),
      "Indices of a polyline's points [cells] that are left when straight lines replace runs of it.");

  m.def(
      "throw_darts",
      [](Grid<double> points, Vector<int64_t> order, Grid<double> taken, double spacing, int64_t limit) {
        const size_t n = points.shape(0);
        if (points.shape(1) != 2 || taken.shape(1) != 2) throw std::invalid_argument("a point is x, y");
        if (order.shape(0) != n || limit < 0) throw std::invalid_argument("one place in the order a point");
        for (size_t k = 0; k < n; ++k)
          if (order.data()[k] < 0 || static_cast<size_t>(order.data()[k]) >= n) throw std::out_of_range("order");
        auto chosen = std::make_unique<int64_t[]>(n);
        const int n_chosen = hgs::throw_darts(points.data(), order.data(), static_cast<int>(n), taken.data(),
                                              static_cast<int>(taken.shape(0)), spacing,
                                              static_cast<int>(std::min<int64_t>(limit, n)), chosen.get());
        return owned(std::move(chosen), {static_cast<size_t>(n_chosen)});
      },
      nb::arg("points"), nb::arg("order"), nb::arg("taken"), nb::arg("spacing"), nb::arg("limit"),
      "Indices of points at least a spacing apart, taken in the given order.");

  m.def(
      "improve_latency",
      [](Grid<double> cost, Vector<double> weights, double whole_way, int max_sweeps, Vector<int32_t> order) {
        const size_t n = cost.shape(0);
        if (cost.shape(1) != n || weights.shape(0) != n || order.shape(0) + 1 != n) {
          throw std::invalid_argument("costs, weights and order differ in length");
        }
        for (size_t k = 0; k + 1 < n; ++k)
          if (order.data()[k] < 1 || order.data()[k] >= static_cast<int32_t>(n)) throw std::out_of_range("order");
        auto improved = std::make_unique<int32_t[]>(n - 1);
        std::copy_n(order.data(), n - 1, improved.get());
        double latency = 0.0;
        {
          nb::gil_scoped_release release;
          latency = hgs::improve_latency(cost.data(), weights.data(), static_cast<int>(n), whole_way, max_sweeps,
                                         improved.get());
        }
        const size_t shape[1] = {n - 1};
        return std::make_tuple(owned(std::move(improved), shape), latency);
      },
      nb::arg("cost"), nb::arg("weights"), nb::arg("whole_way"), nb::arg("max_sweeps"), nb::arg("order"),
      "An order of places 1.. improved by local search for early, weighted arrivals, and its latency.");

  m.def(
      "open_tour",
      [](Grid<double> cost, int fixed_end) {
        const size_t n = cost.shape(0);
        constexpr double kDearest = 1e100;  // sums of such costs are finite, too
        if (cost.shape(1) != n || n == 0) throw std::invalid_argument("a tour needs a square, non-empty matrix");
        for (size_t k = 0; k < n * n; ++k)
          if (!(std::abs(cost.data()[k]) <= kDearest)) throw std::invalid_argument("tour costs must be finite");
        if (fixed_end == 0 || fixed_end >= static_cast<int>(n)) throw std::out_of_range("fixed end");
        const size_t shape[1] = {n};
        auto order = std::make_unique<int32_t[]>(n);
        double total = 0.0;
        {
          nb::gil_scoped_release release;
          total = hgs::open_tour(cost.data(), static_cast<int>(n), fixed_end, order.get());
        }
        return std::make_tuple(owned(std::move(order), shape), total);
      },
      nb::arg("cost"), nb::arg("fixed_end"),
      "Order of an open tour from node 0 (ending at `fixed_end` unless it is negative) and its cost.");
}

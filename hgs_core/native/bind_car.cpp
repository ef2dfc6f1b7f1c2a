#include <nanobind/stl/tuple.h>

#include <cmath>
#include <memory>
#include <stdexcept>
#include <tuple>
#include <vector>

#include "bind.hpp"
#include "car_kernels.hpp"

namespace nb = nanobind;

namespace {

constexpr double kDearest = 1e6;  // cells: the search for all poses keeps a list for every cell's length up to there
constexpr double kManyTurns = 1e3;  // radians
constexpr double kWidest = 1e9;   // cells: words end as exactly as an angle times the radius

hgs::FloorGrid floor_of(const Grid<uint8_t>& blocked, const Grid<float>& clearance, const Grid<float>* soft_cost) {
  const auto same = [&](const Grid<float>& other) {
    return other.shape(0) == blocked.shape(0) && other.shape(1) == blocked.shape(1);
  };
  if (!same(clearance) || (soft_cost && !same(*soft_cost))) throw std::invalid_argument("grids differ in shape");
  return {blocked.data(), clearance.data(), soft_cost ? soft_cost->data() : nullptr, static_cast<int>(blocked.shape(0)),
          static_cast<int>(blocked.shape(1))};
}

std::vector<hgs::Pose> poses_of(const Grid<double>& table) {
  if (table.shape(1) != 3) throw std::invalid_argument("a pose is x, y, yaw");
  std::vector<hgs::Pose> poses(table.shape(0));
  for (size_t k = 0; k < poses.size(); ++k) {
    const double* row = table.data() + 3 * k;
    for (int axis = 0; axis < 3; ++axis)
      if (!std::isfinite(row[axis])) throw std::invalid_argument("a pose is not finite");
    // After very many turns a yaw is too coarse for the small angles that are added to it.
    const double yaw = std::abs(row[2]) > kManyTurns ? std::atan2(std::sin(row[2]), std::cos(row[2])) : row[2];
    poses[k] = {row[0], row[1], yaw};
  }
  return poses;
}

hgs::CarBody body_of(const Vector<double>& body) {
  if (body.shape(0) != 3) throw std::invalid_argument("a body is rear, front, half width");
  const double* b = body.data();
  if (!(b[0] >= 0.0 && b[1] >= 0.0 && b[0] + b[1] > 0.0 && b[2] > 0.0 && std::isfinite(b[0] + b[1] + b[2]))) {
    throw std::invalid_argument("a body has an extent");
  }
  return {b[0], b[1], b[2]};
}

hgs::Car car_of(const Vector<double>& body, double radius, const Vector<double>& costs) {
  if (costs.shape(0) != 3) throw std::invalid_argument("costs are reverse, gear, steer");
  const double* c = costs.data();
  const bool moderate = radius <= kWidest && c[0] + c[1] + c[2] < kDearest;
  if (!(moderate && radius > 0.0 && c[0] >= 1.0 && c[1] >= 0.0 && c[2] >= 0.0)) {
    throw std::invalid_argument("radius or costs");
  }
  return {body_of(body), radius, {c[0], c[1], c[2]}};
}

}  // namespace

void bind_car(nb::module_& m) {
  m.def(
      "reeds_shepp_lengths",
      [](Grid<double> starts, Grid<double> goals, double radius) {
        const std::vector<hgs::Pose> from = poses_of(starts), to = poses_of(goals);
        if (!(radius > 0.0 && std::isfinite(radius))) throw std::invalid_argument("the radius must be positive and finite");
        auto lengths = std::make_unique<double[]>(from.size() * to.size());
        {
          nb::gil_scoped_release release;
          for (size_t a = 0; a < from.size(); ++a)
            for (size_t b = 0; b < to.size(); ++b)
              lengths[a * to.size() + b] = radius * hgs::reeds_shepp_length(hgs::seen_from(from[a], to[b], radius));
        }
        return owned(std::move(lengths), {from.size(), to.size()});
      },
      nb::arg("starts"), nb::arg("goals"), nb::arg("radius"), "Lengths of the shortest ways without obstacles, n x m.");

  m.def(
      "reeds_shepp_words",
      [](Vector<double> goal) {
        if (goal.shape(0) != 3) throw std::invalid_argument("a pose is x, y, yaw");
        for (int axis = 0; axis < 3; ++axis)
          if (!std::isfinite(goal.data()[axis])) throw std::invalid_argument("a pose is not finite");
        hgs::Word words[hgs::kMostWords];
        const int n = hgs::reeds_shepp_words({goal.data()[0], goal.data()[1], goal.data()[2]}, words);
        auto table = std::make_unique<double[]>(static_cast<size_t>(n) * 2 * hgs::Word::kMost);
        for (int k = 0; k < n; ++k)
          for (int p = 0; p < hgs::Word::kMost; ++p) {
            table[static_cast<size_t>((k * hgs::Word::kMost + p) * 2)] = words[k].turn[p];
            table[static_cast<size_t>((k * hgs::Word::kMost + p) * 2 + 1)] = words[k].length[p];
          }
        return owned(std::move(table), {static_cast<size_t>(n), static_cast<size_t>(hgs::Word::kMost), 2});
      },
      nb::arg("goal"), "All words to a pose for radius 1: (n, 5, 2) turns and signed lengths.");

  m.def(
      "car_poses_free",
      [](Grid<uint8_t> blocked, Grid<float> clearance, Vector<double> body, Grid<double> poses,
         Grid<double> standing) {
        const hgs::FloorGrid floor = floor_of(blocked, clearance, nullptr);
        const std::vector<hgs::Pose> at = poses_of(poses), stands = poses_of(standing);
        if (stands.size() > 1) throw std::invalid_argument("a car stands at one pose");
        hgs::CarSpace space(floor, body_of(body));
        if (!stands.empty()) space.forgive(stands[0]);
        auto free = std::make_unique<bool[]>(at.size());
        {
          nb::gil_scoped_release release;
          for (size_t k = 0; k < at.size(); ++k) free[k] = space.is_free(at[k]);
        }
        return owned(std::move(free), {at.size()});
      },
      nb::arg("blocked"), nb::arg("clearance"), nb::arg("body"), nb::arg("poses"), nb::arg("standing"),
      "Which poses [cells, radians] a rectangle fits at; what it meets where it is standing (0 or 1 poses) is forgiven.");

  m.def(
      "hybrid_astar",
      [](Grid<uint8_t> blocked, Grid<float> clearance, Grid<float> soft_cost, Grid<float> cost, Vector<double> body,
         double radius, Vector<double> costs, Grid<double> start, Grid<double> goals, double weight, int most_expanded,
         double step) {
        const hgs::FloorGrid floor = floor_of(blocked, clearance, &soft_cost);
        floor_of(blocked, cost, nullptr);
        const hgs::Car car = car_of(body, radius, costs);
        const std::vector<hgs::Pose> from = poses_of(start), to = poses_of(goals);
        if (from.size() != 1 || to.empty()) throw std::invalid_argument("one start and at least one goal");
        if (!(weight >= 0.0 && std::isfinite(weight) && step > 0.0)) throw std::invalid_argument("weight or step");
        std::vector<hgs::WayPose> way;
        double total = INFINITY;
        int expanded = 0;
        {
          nb::gil_scoped_release release;
          const std::vector<hgs::Piece> pieces =
              hgs::hybrid_astar(floor, cost.data(), car, from[0], to.data(), static_cast<int>(to.size()),
                                {weight, most_expanded}, &expanded);
          if (!pieces.empty()) {
            way = hgs::sampled_way(car, from[0], pieces, step);
            total = hgs::way_cost(floor, car, from[0], pieces);
          }
        }
        auto table = std::make_unique<double[]>(way.size() * 4);
        for (size_t k = 0; k < way.size(); ++k) {
          table[4 * k] = way[k].x;
          table[4 * k + 1] = way[k].y;
          table[4 * k + 2] = way[k].yaw;
          table[4 * k + 3] = way[k].turn;
        }
        return std::make_tuple(owned(std::move(table), {way.size(), 4}), total, expanded);
      },
      nb::arg("blocked"), nb::arg("clearance"), nb::arg("soft_cost"), nb::arg("cost"), nb::arg("body"),
      nb::arg("radius"), nb::arg("costs"), nb::arg("start"), nb::arg("goals"), nb::arg("weight"),
      nb::arg("most_expanded"), nb::arg("step"),
      "A car's way to the cheapest of the goals: (n, 4) x, y, yaw, turn (none: no way), its cost, states looked at.");

  m.def(
      "car_reach",
      [](Grid<uint8_t> blocked, Grid<float> clearance, Vector<double> body, double radius, Vector<double> costs,
         Grid<double> start, int n_headings) {
        const hgs::FloorGrid floor = floor_of(blocked, clearance, nullptr);
        const hgs::Car car = car_of(body, radius, costs);
        const std::vector<hgs::Pose> from = poses_of(start);
        if (from.size() != 1 || n_headings < 1) throw std::invalid_argument("one start, at least one heading");
        const size_t shape[3] = {blocked.shape(0), blocked.shape(1), static_cast<size_t>(n_headings)};
        auto reach = std::make_unique<float[]>(shape[0] * shape[1] * shape[2]);
        {
          nb::gil_scoped_release release;
          hgs::car_reach(floor, car, from[0], n_headings, reach.get());
        }
        return owned(std::move(reach), shape);
      },
      nb::arg("blocked"), nb::arg("clearance"), nb::arg("body"), nb::arg("radius"), nb::arg("costs"), nb::arg("start"),
      nb::arg("n_headings"), "Least cost of driving to every cell and heading, (nx, ny, n_headings).");
}

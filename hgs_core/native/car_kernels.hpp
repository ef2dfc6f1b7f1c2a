// Ways of a car among the blocked cells of a floor plan. Plain arrays, no Python; all lengths are in cells.
#pragma once
#include <cstdint>
#include <vector>

#include "car_body.hpp"

namespace hgs {

// What a way costs: its length times the floor's soft cost, and what makes a driver shake his head.
struct CarCosts {
  double reverse;  // factor on what is driven backwards, at least 1
  double gear;     // for every change between forwards and backwards [cells]
  double steer;    // for turning the wheels from one side to the other, in proportion below that [cells]
};

struct Car {
  CarBody body;
  double radius;  // of the tightest turn, at the reference point [cells]
  CarCosts costs;
};

// A piece of a way: `turn` is the curvature as a share of the greatest one (+ = left), `length` is negative backwards.
struct Piece {
  double turn, length;
};

// One sample of a way: its pose and the piece that led to it (0 at the start).
struct WayPose {
  double x, y, yaw, turn;
};

struct CarSearch {
  double weight;      // of the heuristic: more finds a way sooner and a worse one
  int most_expanded;  // gives up after so many states
};

// Hybrid A* from `start` to the cheapest of `goals` (one place, several headings). Empty: no way was found. `expanded`
// is how many states were looked at. The heuristic is the greater of the way on the grid over `cost` (+inf where no
// pose of the car can be) and the Reeds-Shepp length.
std::vector<Piece> hybrid_astar(const FloorGrid& floor, const float* cost, const Car& car, const Pose& start,
                                const Pose* goals, int n_goals, const CarSearch& search, int* expanded);

// A way with runs of pieces replaced by Reeds-Shepp words wherever those are free and cost less.
std::vector<Piece> shortened_way(const CarSpace& space, const FloorGrid& floor, const Car& car, const Pose& start,
                                 std::vector<Piece> way);

// What `way` from `start` costs.
double way_cost(const FloorGrid& floor, const Car& car, const Pose& start, const std::vector<Piece>& way);

// Samples at most `step` apart; every piece has at least two.
std::vector<WayPose> sampled_way(const Car& car, const Pose& start, const std::vector<Piece>& way, double step);

// The least cost of driving from `start` to every (cell, heading), each length plain (no soft cost), gear changes and
// backwards as in `car.costs`: reach[(i * ny + j) * n_headings + h], +inf where no way was found. Heading h stands for
// yaws about 2 pi h / n_headings.
void car_reach(const FloorGrid& floor, const Car& car, const Pose& start, int n_headings, float* reach);

}  // namespace hgs

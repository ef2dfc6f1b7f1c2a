// What a car's way is made of: how pieces move it, what they cost, whether they are free.
#pragma once
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "car_kernels.hpp"
#include "whole_number.hpp"

namespace hgs {

constexpr double kCheckEvery = 0.5;  // cells along a way between two poses that are held against the floor plan

inline Pose after(const Pose& from, const Piece& piece, double radius) {
  if (std::abs(piece.turn) < 1e-9) {
    return {from.x + piece.length * std::cos(from.yaw), from.y + piece.length * std::sin(from.yaw), from.yaw};
  }
  const double r = radius / piece.turn;
  const double yaw = from.yaw + piece.length / r;
  return {from.x + r * (std::sin(yaw) - std::sin(from.yaw)), from.y - r * (std::cos(yaw) - std::cos(from.yaw)), yaw};
}

inline double soft_cost_at(const FloorGrid& floor, const Pose& pose) {
  const int i = floor_within(pose.x, 0, floor.nx - 1);
  const int j = floor_within(pose.y, 0, floor.ny - 1);
  return floor.soft_cost[static_cast<size_t>(i) * floor.ny + j];
}

// Between two pieces driven one after the other; a piece of length 0 is none.
inline double change_cost(const CarCosts& costs, const Piece& before, const Piece& next) {
  if (before.length == 0.0 || next.length == 0.0) return 0.0;
  const double gear = (before.length > 0.0) != (next.length > 0.0) ? costs.gear : 0.0;
  return gear + 0.5 * costs.steer * std::abs(before.turn - next.turn);
}

// The cost of driving a piece, +inf where the body does not fit; with `space` null it is taken to fit.
inline double drive_cost(const FloorGrid& floor, const CarSpace* space, const Car& car, const Pose& from,
                         const Piece& piece) {
  const int n = parts_of(piece.length, kCheckEvery, 1);
  if (space && n == kMostParts) return std::numeric_limits<double>::infinity();  // longer than any floor
  double soft = 0.0;
  for (int k = 1; k <= n; ++k) {
    const Pose at = after(from, {piece.turn, piece.length * k / n}, car.radius);
    if (space && !space->is_free(at)) return std::numeric_limits<double>::infinity();
    soft += soft_cost_at(floor, at);
  }
  return soft / n * std::abs(piece.length) * (piece.length < 0.0 ? car.costs.reverse : 1.0);
}

// The cheapest free word from `start` to `goal`, between the pieces `before` and `next` (of length 0: none), if it costs
// less than `most`; its cost is returned, and +inf otherwise.
double cheapest_word(const FloorGrid& floor, const CarSpace& space, const Car& car, const Pose& start, const Pose& goal,
                     const Piece& before, const Piece& next, double most, std::vector<Piece>& pieces);

}  // namespace hgs

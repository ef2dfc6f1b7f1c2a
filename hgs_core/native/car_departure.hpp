// How a car gets going where the lattices' steps are too long: short pieces to and fro around where it stands.
#pragma once
#include <cstdint>
#include <vector>

#include "car_kernels.hpp"

namespace hgs {

struct Departure {
  Pose pose;
  Piece piece;     // that led here
  int32_t parent;  // -1: where the car stands
  double cost;     // plain: no soft cost
};

// Everywhere near `start` that the car gets to by short pieces; first `start` itself, parents before children.
std::vector<Departure> departures(const CarSpace& space, const Car& car, const Pose& start);

}  // namespace hgs

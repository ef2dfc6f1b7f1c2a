// Where the rectangle of a car's body fits between the blocked cells of a floor plan. Lengths are in cells.
#pragma once
#include <cstdint>
#include <limits>
#include <vector>

#include "grid_kernels.hpp"
#include "reeds_shepp.hpp"

namespace hgs {

// The rectangle about the reference point (the middle of the rear axle), x ahead.
struct CarBody {
  double rear;        // how far it reaches behind the reference point
  double front;       // and ahead of it
  double half_width;  // to either side
};

// Exact: a pose is free when the open rectangle meets no blocked cell's box; everything outside the grid is blocked.
// Where a few discs that cover the rectangle have room by the clearance field, that is all that is looked at.
class CarSpace {
 public:
  CarSpace(const FloorGrid& floor, const CarBody& body);

  // Where the body meets something at the pose that it stands in, it is there and must leave: near that pose a slimmer
  // rectangle counts, as much as is free there; and what even the slimmest meets counts as free, as long as it gets no
  // deeper into it.
  void forgive(const Pose& standing);

  bool is_free(const Pose& pose) const;

 private:
  // visit(cell, -1: outside) returns whether to go on; the rectangle is slimmer by `slim` to all sides.
  template <typename Visit>
  void for_each_met(const Pose& pose, double slim, const Visit& visit) const;
  bool meets(const Pose& pose, double slim) const;

  FloorGrid floor_;
  double half_length_, half_width_, middle_;  // of the rectangle; its middle lies so far ahead of the reference point
  int n_discs_;
  double disc_radius_, disc_spacing_, first_disc_;
  struct Forgiven {
    int32_t cell;
    double depth;
  };
  double depth(const Pose& pose, int32_t cell) const;  // of a cell's centre inside the rectangle, negative outside
  double beyond(const Pose& pose) const;  // how far the rectangle reaches over the grid's border

  std::vector<Forgiven> forgiven_;
  double forgiven_beyond_ = -std::numeric_limits<double>::infinity();
  Pose standing_{};
  double slim_ = 0.0;  // > 0: within kLeaving of where it stands
};

}  // namespace hgs

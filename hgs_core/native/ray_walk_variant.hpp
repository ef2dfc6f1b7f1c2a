// Rays walking through unit cells, one in each lane: exact traversal in lockstep (Amanatides & Woo, 1987), where each
// crossing is computed afresh from the number of the plane it crosses, so that rounding does not add up.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

// One axis of the rays' walk.
struct AxisWalk {
  VFloat from, per_cell;  // start, and ray parameter per cell
  VInt forward;           // which rays go up
  VInt cell;
  VFloat t_next;

  HGS_INLINE void plan() {
    t_next = (to_float(cell - forward) - from) * per_cell;  // a true comparison is -1
  }
  HGS_INLINE void step(VInt lanes) {
    cell += lanes & (forward ? VInt{} + 1 : VInt{} - 1);
    plan();
  }
};

// Narrows [t_first, t_last] to the part inside the grid.
HGS_INLINE AxisWalk enter_axis(float from, VFloat d, float cells, VFloat& t_first, VFloat& t_last) {
  const VFloat tiny = splat_all(1e-6f);
  const VFloat safe = (d < tiny) & (d > -tiny) ? tiny : d;
  AxisWalk axis;
  axis.from = splat_all(from);
  axis.per_cell = 1.0f / safe;
  axis.forward = safe > 0.0f;
  const VFloat at_low = -from * axis.per_cell, at_high = (cells - from) * axis.per_cell;
  t_first = vmax(t_first, vmin(at_low, at_high));
  t_last = vmin(t_last, vmax(at_low, at_high));
  return axis;
}

HGS_INLINE void start_axis(AxisWalk& axis, VFloat d, VFloat t_first, int cells) {
  const VInt cell = to_cell(axis.from + t_first * d), last = VInt{} + (cells - 1);
  axis.cell = cell < 0 ? VInt{} : (cell > last ? last : cell);
  axis.plan();
}

// Sixteen rays from one place; t = 0 at its start, 1 at its end.
struct RayWalk {
  AxisWalk x, y, z;
  VFloat t_enter, t_last;
  VInt active;

  HGS_INLINE RayWalk(const float* from, VFloat dx, VFloat dy, VFloat dz, const std::int32_t* shape, VFloat t_first,
                     VFloat t_end)
      : t_enter(t_first), t_last(t_end) {
    x = enter_axis(from[0], dx, static_cast<float>(shape[0]), t_enter, t_last);
    y = enter_axis(from[1], dy, static_cast<float>(shape[1]), t_enter, t_last);
    z = enter_axis(from[2], dz, static_cast<float>(shape[2]), t_enter, t_last);
    start_axis(x, dx, t_enter, shape[0]);
    start_axis(y, dy, t_enter, shape[1]);
    start_axis(z, dz, t_enter, shape[2]);
    active = t_enter < t_last;
  }
  HGS_INLINE VInt cell(const std::int32_t* shape) const { return (x.cell * shape[1] + y.cell) * shape[2] + z.cell; }
  HGS_INLINE VFloat t_leave() const {
    return vmax(vmin(vmin(vmin(x.t_next, y.t_next), z.t_next), t_last), t_enter);
  }
  // To the next cell; `t` is `t_leave()` of this one.
  HGS_INLINE void advance(VFloat t, const std::int32_t* shape) {
    const VInt by_x = (x.t_next <= y.t_next) & (x.t_next <= z.t_next);
    const VInt by_y = ~by_x & (y.t_next <= z.t_next);
    x.step(by_x);
    y.step(by_y);
    z.step(~(by_x | by_y));
    t_enter = t;
    active &= (t < t_last) & (x.cell >= 0) & (x.cell < shape[0]) & (y.cell >= 0) & (y.cell < shape[1]) &
              (z.cell >= 0) & (z.cell < shape[2]);
  }
};

}  // namespace hgs::HGS_VARIANT

// How big a Gaussian looks, and how it lies: what is left of its shape on the screen.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "rasterise_workspace.hpp"
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

// From (u, v): how far to the left and to the right a splat reaches, in some rows of pixels.
struct LaneChord {
  VFloat left, right;
};

struct RoundLook {
  VFloat falloff, own_variance, reach_x, reach_y;

  // In the rows from `above` to -`below` as seen from v: along the nearest of them.
  HGS_INLINE LaneChord chord(VFloat above, VFloat below) const {
    const VFloat dy = vmax(vmax(above, below), VFloat{});
    const VFloat chord = vsqrt(vmax(reach_x * reach_x - dy * dy, VFloat{}));
    return {chord, chord};
  }
};

struct DiscLook {
  VFloat across, lean, down;  // see DiscSpot
  VFloat slope_h, slope_y, decay, reach_x, reach_y;
  VFloat tilt;  // dy where the ellipse reaches farthest to the right

  HGS_INLINE LaneChord chord(VFloat above, VFloat below) const {
    const VFloat widest2 = decay / across, per_reach = 1.0f / reach_y;
    const auto half = [&](VFloat dy) HGS_LAMBDA {
      const VFloat share = dy * per_reach;
      return vsqrt(widest2 * vmax(1.0f - share * share, VFloat{})) + 0.01f;
    };
    const VFloat at_right = vmin(vmax(tilt, above), -below), at_left = vmin(vmax(-tilt, above), -below);
    return {half(at_left) - lean * at_left, lean * at_right + half(at_right)};
  }
};

HGS_INLINE VFloat held(VFloat a, float widest) { return vmin(vmax(a, splat_all(-widest)), splat_all(widest)); }

// Discs in the camera's frame: their normals, the ways (tx, ty, 1) to their centres, their radii in pixels along x and
// y, and in metres.
struct LaneDisc {
  VFloat nx, ny, nz, tx, ty, size_x, size_y, radius;
};

// With j1 = fx / z (1, 0, -tx), j2 = fy / z (0, 1, -ty) the rows of J: the determinant of J (1 - n n') J' is
// (n . (j1 x j2))^2, a square, where the difference of products would be rounding.
HGS_INLINE DiscLook look_of(const LaneDisc& disc, VFloat low_pass, VFloat decay) {
  const VFloat nx = disc.nx, ny = disc.ny, nz = disc.nz, tx = disc.tx, ty = disc.ty;
  const VFloat size_x = disc.size_x, size_y = disc.size_y;
  const VFloat n_1 = nx - tx * nz, n_2 = ny - ty * nz;  // of j1, j2 along n
  const VFloat nought{};  // less than it, rounding
  const VFloat own_xx = size_x * size_x * vmax(1.0f + tx * tx - n_1 * n_1, nought);
  const VFloat own_yy = size_y * size_y * vmax(1.0f + ty * ty - n_2 * n_2, nought);
  const VFloat xy = size_x * size_y * (tx * ty - n_1 * n_2);
  const VFloat area = size_x * size_y * (nx * tx + ny * ty + nz);
  const VFloat share = 1.0f / (area * area + low_pass * (own_xx + own_yy) + low_pass * low_pass);
  const VFloat var_x = own_xx + low_pass, var_y = own_yy + low_pass, per_var_y = 1.0f / var_y;
  const VFloat depth_x = -disc.radius * size_x * (tx + n_1 * nz), depth_y = -disc.radius * size_y * (ty + n_2 * nz);
  DiscLook look;
  look.across = HALF_LOG2_E * share * var_y;
  look.lean = xy * per_var_y;
  look.down = HALF_LOG2_E * per_var_y;
  look.slope_h = share * var_y * (depth_x - look.lean * depth_y);
  look.slope_y = per_var_y * depth_y;
  look.decay = decay;
  look.reach_x = vsqrt(decay * (1.0f / HALF_LOG2_E) * var_x) + 0.01f;
  look.reach_y = vsqrt(decay * (1.0f / HALF_LOG2_E) * var_y) + 0.01f;
  look.tilt = look.reach_x * xy / var_x;
  return look;
}

// The look of LANES rows of a block at once.
template <class Shape>
class LookFrom;

template <>
class LookFrom<Isotropic> {
 public:
  HGS_INLINE LookFrom(const GaussianRows&, std::uint32_t, int, const PinholeCamera& camera)
      : f2_(camera.fx * camera.fy), low_pass_(camera.low_pass_px2) {}

  // `radius`: r / z; `decay`: of the exponent to base 2, where a falls below 1/255.
  HGS_INLINE RoundLook operator()(int, VFloat, VFloat, VFloat, VFloat radius, VFloat decay) const {
    RoundLook look;
    look.own_variance = f2_ * radius * radius;
    look.falloff = HALF_LOG2_E / (look.own_variance + low_pass_);
    look.reach_x = look.reach_y = vsqrt(decay / look.falloff) + 0.01f;
    return look;
  }

 private:
  float f2_, low_pass_;
};

template <>
class LookFrom<Disc> {
 public:
  HGS_INLINE LookFrom(const GaussianRows& gaussians, std::uint32_t first_row, int n_rows, const PinholeCamera& camera)
      : camera_(camera), widest_(widest_tangents(camera)) {
    const float* rows = gaussians.normals + N_NORMAL * std::size_t{first_row};
    for (int i = 0; i < n_rows; ++i) {
      for (int k = 0; k < N_NORMAL; ++k) normals_[k][i] = rows[N_NORMAL * i + k];
    }
    for (int i = n_rows; i % LANES != 0; ++i) {
      for (int k = 0; k < N_NORMAL; ++k) normals_[k][i] = 0.0f;
    }
  }

  // (x, y, 1): the way to the centre, at depth `z`.
  HGS_INLINE DiscLook operator()(int base, VFloat x, VFloat y, VFloat z, VFloat radius, VFloat decay) const {
    const float* R = camera_.rotation;
    const VFloat a = load(normals_[0] + base), b = load(normals_[1] + base), c = load(normals_[2] + base);
    const LaneDisc disc{R[0] * a + R[1] * b + R[2] * c,
                        R[3] * a + R[4] * b + R[5] * c,
                        R[6] * a + R[7] * b + R[8] * c,
                        held(x, widest_.x),
                        held(y, widest_.y),
                        camera_.fx * radius,
                        camera_.fy * radius,
                        radius * z};
    return look_of(disc, splat_all(camera_.low_pass_px2), decay);
  }

 private:
  const PinholeCamera& camera_;
  Tangents widest_;
  alignas(64) float normals_[N_NORMAL][BLOCK + 16];
};

// The same in memory, to be taken lane by lane.
template <class Shape>
struct StoredLook;

template <>
struct StoredLook<Isotropic> {
  alignas(64) float falloff[LANES], own_variance[LANES], reach[LANES];

  HGS_INLINE void keep(const RoundLook& look) {
    store(falloff, look.falloff);
    store(own_variance, look.own_variance);
    store(reach, look.reach_x);
  }
  HGS_INLINE void give(int lane, RoundSplat& splat) const {
    splat.falloff = falloff[lane];
    splat.own_variance = own_variance[lane];
    splat.reach = reach[lane];
  }
};

template <>
struct StoredLook<Disc> {
  alignas(64) float across[LANES], lean[LANES], down[LANES], slope_h[LANES], slope_y[LANES];
  alignas(64) float decay[LANES], reach_x[LANES], reach_y[LANES];

  HGS_INLINE void keep(const DiscLook& look) {
    store(across, look.across);
    store(lean, look.lean);
    store(down, look.down);
    store(slope_h, look.slope_h);
    store(slope_y, look.slope_y);
    store(decay, look.decay);
    store(reach_x, look.reach_x);
    store(reach_y, look.reach_y);
  }
  HGS_INLINE void give(int lane, DiscSplat& splat) const {
    splat.across = across[lane];
    splat.lean = lean[lane];
    splat.down = down[lane];
    splat.slope_h = slope_h[lane];
    splat.slope_y = slope_y[lane];
    splat.decay = decay[lane];
    splat.reach_x = reach_x[lane];
    splat.reach_y = reach_y[lane];
  }
};

}  // namespace hgs::HGS_VARIANT

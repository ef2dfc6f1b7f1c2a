// From sums over pixels to the parameters of an isotropic Gaussian.
// Included only by the variant files (see simd.hpp).
//
// With e = -d^2 / (2 sigma^2), k = 1 / (2 sigma^2) and s^2 = (f r / z)^2, by a parameter theta:
//   de/dtheta = 2k dx du/dtheta + 2k dy dv/dtheta + 2k^2 d^2 ds^2/dtheta
//   camera x:   du = fx / z                          camera y: dv = fy / z
//   camera z:   du = -(u - cx) / z, dv = -(v - cy) / z, ds^2 = -2 s^2 / z
//   log radius: ds^2 = 2 s^2                         logit opacity: dlog(a) = 1 - o
// A centre in the world: camera coordinates = R c + t, so its derivatives are R^T of those.
#pragma once
#include "rasterise_information.hpp"

namespace hgs::HGS_VARIANT {

// A splat's sums over all its tiles.
template <class Shape>
struct PairSums {
  VFloat8 parts[Shape::SUMS / 8];
  HGS_INLINE float operator[](int k) const { return parts[k / 8][k % 8]; }
};

// A camera, and its axes in the world as rows of parameters.
struct View {
  const PinholeCamera& camera;
  VFloat8 x, y, z;

  HGS_INLINE explicit View(const PinholeCamera& seen) : camera(seen) {
    const float* R = camera.rotation;
    x = VFloat8{R[0], R[1], R[2]};
    y = VFloat8{R[3], R[4], R[5]};
    z = VFloat8{R[6], R[7], R[8]};
  }
};

// By the eight parameters, and for discs by the normal (the lanes beyond its three are 0).
template <class Shape>
struct RowGradient {
  VFloat8 parameters;
};

template <>
struct RowGradient<Disc> {
  VFloat8 parameters, normal;
};

// Coefficients of dx, dy and d^2 in de/dtheta: d/dx = dx x, d/dy = dy y, d/dz = dx z_dx + dy z_dy + d^2 z_d2 in the
// camera's frame, and d^2 alone for the log radius.
class RoundSlopes {
 public:
  HGS_INLINE RoundSlopes(const RoundSplat& splat, const View& view) : splat_(splat), view_(view) {
    const PinholeCamera& camera = view.camera;
    const float k = splat.falloff * 0.69314718f;
    const float two_k = 2.0f * k, inverse_z = 1.0f / splat.z;
    log_radius_ = two_k * k * 2.0f * splat.own_variance;
    x_ = two_k * camera.fx * inverse_z;
    y_ = two_k * camera.fy * inverse_z;
    z_dx_ = -two_k * (splat.u - camera.cx) * inverse_z;
    z_dy_ = -two_k * (splat.v - camera.cy) * inverse_z;
    z_d2_ = -log_radius_ * inverse_z;
  }

  HGS_INLINE RowGradient<Isotropic> gradient(const PairSums<Isotropic>& pair_sums) const {
    namespace s = round_sums;
    const VFloat8 sums = pair_sums.parts[0];
    const float along_z = z_dx_ * sums[s::P_DX] + z_dy_ * sums[s::P_DY] + z_d2_ * sums[s::P_D2] + sums[s::Z];
    const VFloat8 centre = view_.x * (x_ * sums[s::P_DX]) + view_.y * (y_ * sums[s::P_DY]) + view_.z * along_z;
    typedef std::int32_t Lanes __attribute__((vector_size(32)));
    const VFloat8 others = __builtin_shuffle(sums, Lanes{s::P, s::P, s::P, s::R, s::G, s::B, s::P_D2, s::P});
    return {centre + others * VFloat8{0.0f, 0.0f, 0.0f, 1.0f, 1.0f, 1.0f, log_radius_, 1.0f - splat_.opacity}};
  }

  // Adds the information that the sums of a Fisher sweep hold.
  HGS_INLINE void add_information(const PairSums<Isotropic>& pair_sums, float* H) const {
    namespace s = round_fisher;
    const VFloat8 sums = pair_sums.parts[0];
    for (int j = 0; j < 3; ++j) {
      float a[3];
      world(j, a);
      const float value = a[0] * a[0] * sums[s::E_XX] + a[1] * a[1] * sums[s::E_YY] + a[2] * a[2] * sums[s::E_DD] +
                          2.0f * (a[0] * a[1] * sums[s::E_XY] + a[0] * a[2] * sums[s::E_XD] +
                                  a[1] * a[2] * sums[s::E_YD]);
      H[j] += value > 0.0f ? value : 0.0f;  // rounding of a difference that is no less than 0
      H[3 + j] += sums[s::W2];
    }
    H[6] += log_radius_ * log_radius_ * sums[s::E_DD];
    H[7] += (1.0f - splat_.opacity) * (1.0f - splat_.opacity) * sums[s::E];
  }

  // The form whose value at a pixel is sum_k (dC/dw_k)^2 share_k, with the colours' shares in c[W2]: see sweep_quality.
  HGS_INLINE void form(const float share[N_PARAMETERS], float* c) const {
    namespace s = round_fisher;
    for (int j = 0; j < 3; ++j) {
      float a[3];
      world(j, a);
      c[s::E_XX] += share[j] * a[0] * a[0];
      c[s::E_XY] += share[j] * 2.0f * a[0] * a[1];
      c[s::E_YY] += share[j] * a[1] * a[1];
      c[s::E_XD] += share[j] * 2.0f * a[0] * a[2];
      c[s::E_YD] += share[j] * 2.0f * a[1] * a[2];
      c[s::E_DD] += share[j] * a[2] * a[2];
      c[s::W2] += share[3 + j];
    }
    c[s::E_DD] += log_radius_ * log_radius_ * share[6];
    c[s::E] = (1.0f - splat_.opacity) * (1.0f - splat_.opacity) * share[7];
  }

 private:
  // Coefficients of (dx, dy, d^2) by the world coordinate `axis`.
  HGS_INLINE void world(int axis, float out[3]) const {
    const float* R = view_.camera.rotation + axis;
    out[0] = R[0] * x_ + R[6] * z_dx_;
    out[1] = R[3] * y_ + R[6] * z_dy_;
    out[2] = R[6] * z_d2_;
  }

  const RoundSplat& splat_;
  const View& view_;
  float x_, y_, z_dx_, z_dy_, z_d2_;
  float log_radius_;
};

}  // namespace hgs::HGS_VARIANT

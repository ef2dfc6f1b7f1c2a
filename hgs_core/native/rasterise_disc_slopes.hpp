// From sums over pixels to the parameters of discs, one or LANES of them at a time.
// Included only by the variant files (see simd.hpp).
//
// With q = Q d and V = Q^-1 = r^2 J (1 - n n') J' + low_pass, the exponent e = -d' Q d / 2 has, by a parameter theta,
//   de/dtheta = q . d(u, v)/dtheta + q' (dV/dtheta) q / 2
// since dQ = -Q dV Q. Its depth at the pixel, z + q . s, has dz/dtheta + q . ds/dtheta - slope . d(u, v)/dtheta
// - q' (dV/dtheta) slope, slope = Q s. With j1, j2 the rows of J, t = (x, y) / z (held within limits, where it is a
// constant) and k_i = j_i - (j_i . n) n:
//   V_ij = r^2 j_i . k_j,   s_i = r^2 k_i . e_z
//   dj1/dx = -fx / z^2 e_z, dj1/dz = fx / z^2 (-1, 0, 2 t_x), j2 likewise;   dV/d(log r) = 2 V, ds/d(log r) = 2 s
// and, by the normal, d(1 - n n') = -(dn n' + n dn'). It stays a unit vector: only what is tangent counts.
#pragma once
#include "rasterise_slopes.hpp"

namespace hgs::HGS_VARIANT {

HGS_INLINE float exp_of(float x) { return __builtin_expf(x); }
HGS_INLINE VFloat exp_of(VFloat x) { return vexp(x); }

template <class V>
struct Vector3 {
  V x, y, z;
};

template <class V>
HGS_INLINE V dot(const Vector3<V>& a, const Vector3<V>& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

template <class V>
HGS_INLINE Vector3<V> along(const Vector3<V>& a, V share, const Vector3<V>& b) {
  return {a.x + share * b.x, a.y + share * b.y, a.z + share * b.z};
}

// A symmetric 2 x 2 matrix, or how something grows with one; `xy` stands for both of its entries.
template <class V>
struct Symmetric {
  V xx, xy, yy;
};

// What is known of discs: on the screen, and in the world. V: float, or VFloat for LANES of them.
template <class V>
struct SeenDisc {
  V u, v, z, across, lean, down, slope_h, slope_y, opacity, log_radius;
  Vector3<V> normal;
};

HGS_INLINE SeenDisc<float> seen_disc(const DiscSplat& splat, const GaussianRows& rows) {
  const float* n = rows.normals + N_NORMAL * std::size_t{splat.row};
  const float log_radius = rows.parameters[N_PARAMETERS * std::size_t{splat.row} + 6];
  return {splat.u,       splat.v,       splat.z,       splat.across,  splat.lean,       splat.down,
          splat.slope_h, splat.slope_y, splat.opacity, log_radius,    {n[0], n[1], n[2]}};
}

// By the parameters, but the colours.
template <class V>
struct DiscGradient {
  Vector3<V> centre;
  V log_radius, logit_opacity;
  Vector3<V> normal;
};

template <class V>
struct DiscExponent {
  V x, y, z, log_radius;
};

template <class V>
class DiscSlopes {
 public:
  HGS_INLINE DiscSlopes(const SeenDisc<V>& seen, const PinholeCamera& camera, const Tangents& widest)
      : seen_(seen), camera_(camera), n_(to_camera(seen.normal)) {
    const V one = V{} + 1.0f, nought{};
    r2_ = exp_of(2.0f * seen.log_radius);
    const V inverse_z = 1.0f / seen.z;
    x_ = (seen.u - camera.cx) * (1.0f / camera.fx);
    y_ = (seen.v - camera.cy) * (1.0f / camera.fy);
    const V widest_x = V{} + widest.x, widest_y = V{} + widest.y;
    const V tx = x_ > widest_x ? widest_x : (x_ < -widest_x ? -widest_x : x_);
    const V ty = y_ > widest_y ? widest_y : (y_ < -widest_y ? -widest_y : y_);
    const V free_x = tx == x_ ? one : nought, free_y = ty == y_ ? one : nought;
    scale_x_ = camera.fx * inverse_z;
    scale_y_ = camera.fy * inverse_z;
    j1_ = {scale_x_, nought, -scale_x_ * tx};
    j2_ = {nought, scale_y_, -scale_y_ * ty};
    k1_ = along(j1_, -dot(j1_, n_), n_);
    k2_ = along(j2_, -dot(j2_, n_), n_);
    // dV by the camera's x and y, and by z.
    const V cx = -r2_ * scale_x_ * inverse_z, cy = -r2_ * scale_y_ * inverse_z;
    const V gx = cx * free_x, gy = cy * free_y;
    const V hx = -cx * tx * (1.0f + free_x), hy = -cy * ty * (1.0f + free_y);
    by_x_ = {2.0f * gx * k1_.z, gx * k2_.z, nought};
    by_y_ = {nought, gy * k1_.z, 2.0f * gy * k2_.z};
    by_z_ = {2.0f * (cx * k1_.x + hx * k1_.z), cx * k2_.x + hx * k2_.z + cy * k1_.y + hy * k1_.z,
             2.0f * (cy * k2_.y + hy * k2_.z)};
    // ds by the same: s_x with x, s_y with y, both with z.
    const V tzz = 1.0f - n_.z * n_.z;
    s_by_x_ = gx * tzz;
    s_by_y_ = gy * tzz;
    s_x_by_z_ = -cx * n_.x * n_.z + hx * tzz;
    s_y_by_z_ = -cy * n_.y * n_.z + hy * tzz;
  }

  // `sums`: see disc_sums.
  HGS_INLINE DiscGradient<V> gradient(const V* sums) const {
    namespace s = disc_sums;
    // q_x = across h, q_y = down dy - lean q_x.
    const V across = seen_.across * (1.0f / HALF_LOG2_E), down = seen_.down * (1.0f / HALF_LOG2_E);
    const V lean = seen_.lean, slope_x = seen_.slope_h, slope_y = seen_.slope_y - lean * slope_x;
    const V s_x = r2_ * k1_.z, s_y = r2_ * k2_.z;
    const V p_x = across * sums[s::P_H], p_y = down * sums[s::P_DY] - lean * p_x;     // sum P q
    const V z_x = across * sums[s::Z_H], z_y = down * sums[s::Z_DY] - lean * z_x;     // sum Z q: dL/ds
    const V p_hh = across * across * sums[s::P_HH], p_hy = across * down * sums[s::P_HY];
    const V p_xy = p_hy - lean * p_hh;
    const V p_yy = down * down * sums[s::P_YY] - lean * (p_hy + p_xy);
    const V by_u = p_x - slope_x * sums[s::Z], by_v = p_y - slope_y * sums[s::Z];
    // dL by each entry of V.
    const Symmetric<V> M{0.5f * p_hh - z_x * slope_x, 0.5f * (p_xy - z_x * slope_y - z_y * slope_x),
                         0.5f * p_yy - z_y * slope_y};
    const auto by_matrix = [&](const Symmetric<V>& D) HGS_LAMBDA {
      return M.xx * D.xx + 2.0f * M.xy * D.xy + M.yy * D.yy;
    };
    const Vector3<V> centre{by_u * scale_x_ + by_matrix(by_x_) + z_x * s_by_x_,
                            by_v * scale_y_ + by_matrix(by_y_) + z_y * s_by_y_,
                            by_matrix(by_z_) - (by_u * scale_x_ * x_ + by_v * scale_y_ * y_) + z_x * s_x_by_z_ +
                                z_y * s_y_by_z_ + sums[s::Z]};
    // M J n, and J' of it; J' of dL/ds.
    const V n_1 = dot(j1_, n_), n_2 = dot(j2_, n_);
    const V m_1 = M.xx * n_1 + M.xy * n_2, m_2 = M.xy * n_1 + M.yy * n_2;
    Vector3<V> by_n{V{}, V{}, z_x * n_1 + z_y * n_2};
    by_n = along(along(by_n, 2.0f * m_1 + z_x * n_.z, j1_), 2.0f * m_2 + z_y * n_.z, j2_);
    by_n = along(by_n, -dot(by_n, n_), n_);
    return {to_world(centre), 2.0f * (by_matrix(own_variance()) + z_x * s_x + z_y * s_y),
            (1.0f - seen_.opacity) * sums[s::P],
            to_world(Vector3<V>{-r2_ * by_n.x, -r2_ * by_n.y, -r2_ * by_n.z})};
  }

  // de/dtheta of the centre (in the camera's frame) and of the log radius, at a pixel.
  HGS_INLINE DiscExponent<V> exponent(V h, V dy) const {
    const V qx = h * seen_.across * (1.0f / HALF_LOG2_E);
    const V qy = dy * seen_.down * (1.0f / HALF_LOG2_E) - seen_.lean * qx;
    const auto half_form = [&](const Symmetric<V>& D) HGS_LAMBDA {
      return 0.5f * (qx * qx * D.xx + qy * qy * D.yy) + qx * qy * D.xy;
    };
    return {qx * scale_x_ + half_form(by_x_), qy * scale_y_ + half_form(by_y_),
            half_form(by_z_) - (qx * scale_x_ * x_ + qy * scale_y_ * y_), 2.0f * half_form(own_variance())};
  }

  // The information that the sums of a Fisher sweep hold, by the parameters.
  HGS_INLINE void information(const V* sums, V* H) const {
    namespace s = disc_fisher;
    const V nought{};
    const auto expected = [&](const V* a) HGS_LAMBDA {
      V form[s::MOMENTS] = {};
      add_square(a, nought + 1.0f, form);
      V value{};
      for (int k = 0; k < s::MOMENTS; ++k) value += form[k] * sums[k];
      return value > 0.0f ? value : nought;  // rounding of a difference that is no less than 0
    };
    V a[5];
    for (int j = 0; j < 3; ++j) {
      world(j, a);
      H[j] = expected(a);
      H[3 + j] = sums[s::W2];
    }
    log_radius(a);
    H[6] = expected(a);
    H[7] = (1.0f - seen_.opacity) * (1.0f - seen_.opacity) * sums[s::E];
  }

  // As RoundSlopes::form, over the moments of q.
  HGS_INLINE void form(const float share[N_PARAMETERS], float* c) const {
    float a[5];
    for (int j = 0; j < 3; ++j) {
      world(j, a);
      add_square(a, share[j], c);
      c[disc_fisher::W2] += share[3 + j];
    }
    log_radius(a);
    add_square(a, share[6], c);
    c[disc_fisher::E] = (1.0f - seen_.opacity) * (1.0f - seen_.opacity) * share[7];
  }

 private:
  HGS_INLINE Vector3<V> to_camera(const Vector3<V>& v) const {
    const float* R = camera_.rotation;
    return {R[0] * v.x + R[1] * v.y + R[2] * v.z, R[3] * v.x + R[4] * v.y + R[5] * v.z,
            R[6] * v.x + R[7] * v.y + R[8] * v.z};
  }
  HGS_INLINE Vector3<V> to_world(const Vector3<V>& v) const {
    const float* R = camera_.rotation;
    return {R[0] * v.x + R[3] * v.y + R[6] * v.z, R[1] * v.x + R[4] * v.y + R[7] * v.z,
            R[2] * v.x + R[5] * v.y + R[8] * v.z};
  }

  HGS_INLINE Symmetric<V> own_variance() const {
    return {r2_ * dot(k1_, k1_), r2_ * dot(k1_, k2_), r2_ * dot(k2_, k2_)};
  }

  // Coefficients of (q_x, q_y, q_x^2, q_x q_y, q_y^2) by the world coordinate `axis`.
  HGS_INLINE void world(int axis, V out[5]) const {
    const float* R = camera_.rotation + axis;
    out[0] = scale_x_ * (R[0] - R[6] * x_);
    out[1] = scale_y_ * (R[3] - R[6] * y_);
    out[2] = 0.5f * (R[0] * by_x_.xx + R[6] * by_z_.xx);
    out[3] = R[0] * by_x_.xy + R[3] * by_y_.xy + R[6] * by_z_.xy;
    out[4] = 0.5f * (R[3] * by_y_.yy + R[6] * by_z_.yy);
  }

  HGS_INLINE void log_radius(V out[5]) const {
    const Symmetric<V> own = own_variance();
    out[0] = out[1] = V{};
    out[2] = own.xx;
    out[3] = 2.0f * own.xy;
    out[4] = own.yy;
  }

  // Adds share (a . (q_x, q_y, q_x^2, q_x q_y, q_y^2))^2 to the coefficients of the moments of q.
  HGS_INLINE static void add_square(const V a[5], V share, V* c) {
    namespace s = disc_fisher;
    c[s::E_XX] += share * a[0] * a[0];
    c[s::E_XY] += share * 2.0f * a[0] * a[1];
    c[s::E_YY] += share * a[1] * a[1];
    c[s::E_XXX] += share * 2.0f * a[0] * a[2];
    c[s::E_XXY] += share * 2.0f * (a[0] * a[3] + a[1] * a[2]);
    c[s::E_XYY] += share * 2.0f * (a[0] * a[4] + a[1] * a[3]);
    c[s::E_YYY] += share * 2.0f * a[1] * a[4];
    c[s::E_XXXX] += share * a[2] * a[2];
    c[s::E_XXXY] += share * 2.0f * a[2] * a[3];
    c[s::E_XXYY] += share * (a[3] * a[3] + 2.0f * a[2] * a[4]);
    c[s::E_XYYY] += share * 2.0f * a[3] * a[4];
    c[s::E_YYYY] += share * a[4] * a[4];
  }

  const SeenDisc<V>& seen_;
  const PinholeCamera& camera_;
  Vector3<V> n_;  // in the camera's frame, like all that follows
  V r2_, x_, y_, scale_x_, scale_y_;
  Vector3<V> j1_, j2_, k1_, k2_;
  Symmetric<V> by_x_, by_y_, by_z_;
  V s_by_x_, s_by_y_, s_x_by_z_, s_y_by_z_;
};

// Up to LANES discs of a block on their way from sums to what they say of parameters.
class DiscBatch {
 public:
  HGS_INLINE void add(const DiscSplat& splat, const GaussianRows& rows, const PairSums<Disc>& sums) {
    const SeenDisc<float> disc = seen_disc(splat, rows);
    const float known[N_KNOWN] = {disc.u,       disc.v,        disc.z,        disc.across,  disc.lean,
                                  disc.down,    disc.slope_h,  disc.slope_y,  disc.opacity, disc.log_radius,
                                  disc.normal.x, disc.normal.y, disc.normal.z};
    for (int k = 0; k < N_KNOWN; ++k) known_[k][n_] = known[k];
    for (int k = 0; k < Disc::SUMS; ++k) sums_[k][n_] = sums[k];
    rows_[n_++] = splat.row;
  }

  HGS_INLINE bool full() const { return n_ == LANES; }
  HGS_INLINE bool empty() const { return n_ == 0; }

  // Calls visit(row, gradient) for each, and forgets them.
  template <class Visit>
  HGS_INLINE void finish_gradients(const PinholeCamera& camera, Visit&& visit) {
    finish<N_PARAMETERS + N_NORMAL>(
        camera,
        [](const DiscSlopes<VFloat>& slopes, const VFloat* sums, VFloat* columns) HGS_LAMBDA {
          const DiscGradient<VFloat> found = slopes.gradient(sums);
          const VFloat all[] = {found.centre.x, found.centre.y, found.centre.z, sums[disc_sums::R],
                                sums[disc_sums::G], sums[disc_sums::B], found.log_radius, found.logit_opacity,
                                found.normal.x, found.normal.y, found.normal.z};
          for (int k = 0; k < N_PARAMETERS + N_NORMAL; ++k) columns[k] = all[k];
        },
        [&](std::uint32_t row, const float (*g)[LANES], int i) HGS_LAMBDA {
          visit(row, RowGradient<Disc>{{g[0][i], g[1][i], g[2][i], g[3][i], g[4][i], g[5][i], g[6][i], g[7][i]},
                                       {g[8][i], g[9][i], g[10][i]}});
        });
  }

  // Adds `weight` times what they tell to the rows of `information`, and forgets them.
  HGS_INLINE void finish_information(const PinholeCamera& camera, float weight, float* information) {
    finish<N_PARAMETERS>(
        camera,
        [](const DiscSlopes<VFloat>& slopes, const VFloat* sums, VFloat* columns) HGS_LAMBDA {
          slopes.information(sums, columns);
        },
        [&](std::uint32_t row, const float (*H)[LANES], int i) HGS_LAMBDA {
          float* out = information + N_PARAMETERS * std::size_t{row};
          store8(out, load8(out) + weight * VFloat8{H[0][i], H[1][i], H[2][i], H[3][i], H[4][i], H[5][i], H[6][i], H[7][i]});
        });
  }

 private:
  static constexpr int N_KNOWN = 13;

  // work(slopes, sums, columns) for all lanes at once, then give(row, columns, lane) for each.
  template <int COLUMNS, class Work, class Give>
  HGS_INLINE void finish(const PinholeCamera& camera, Work&& work, Give&& give) {
    for (int i = n_; i < LANES; ++i) {  // copies of one: no lane divides by nothing
      for (int k = 0; k < N_KNOWN; ++k) known_[k][i] = known_[k][0];
    }
    const auto of = [&](int k) HGS_LAMBDA { return load(known_[k]); };
    const SeenDisc<VFloat> seen{of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7), of(8), of(9),
                                {of(10), of(11), of(12)}};
    VFloat sums[Disc::SUMS];
    for (int k = 0; k < Disc::SUMS; ++k) sums[k] = load(sums_[k]);
    VFloat found[COLUMNS];
    work(DiscSlopes<VFloat>(seen, camera, widest_tangents(camera)), sums, found);
    alignas(64) float columns[COLUMNS][LANES];
    for (int k = 0; k < COLUMNS; ++k) store(columns[k], found[k]);
    for (int i = 0; i < n_; ++i) give(rows_[i], columns, i);
    n_ = 0;
  }

  alignas(64) float known_[N_KNOWN][LANES];
  alignas(64) float sums_[Disc::SUMS][LANES] = {};
  std::uint32_t rows_[LANES];
  int n_ = 0;
};

}  // namespace hgs::HGS_VARIANT

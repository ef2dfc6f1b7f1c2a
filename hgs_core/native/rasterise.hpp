// Splatting of Gaussians on the CPU: what goes in, what comes out, and the entry points that every instruction-set
// variant provides.
//
//   p = R c + t                      centre in the camera frame [m], z = p_z
//   u = fx p_x / z + cx              screen position [px]; v likewise
//   a = o exp(-d' Q d / 2)           d: from (u, v) to a pixel's centre, at integer + 0.5
//   alpha = min(0.99, a), nothing below 1/255
//   w_i = alpha_i T_i,  T_i = prod_{j < i} (1 - alpha_j), front to back by z, until T < 1e-4
//   C = sum rgb_i w_i,  D = sum z_i(d) w_i,  A = sum w_i = 1 - T
//
// An isotropic Gaussian is a ball of radius r that looks the same from everywhere (SplaTAM, HGS Eq. 1):
//   Q = 1 / sigma^2 with sigma^2 = (f r / z)^2 + low_pass [px^2], f = sqrt(fx fy);  z(d) = z
//
// A disc has a unit normal n and no thickness: covariance r^2 (1 - n n'), seen through the slope J of the projection
// (EWA splatting, Zwicker et al. 2001; J as in 3D Gaussian splatting, Kerbl et al. 2023), J's tangents held within
// 1.3 times those of the image's corners:
//   Q = (r^2 J (1 - n n') J' + low_pass)^-1
//   z(d) = z + d' Q s, s = r^2 J (1 - n n') e_z: the depth that the Gaussian has, in the mean, at that pixel
#pragma once
#include <cstddef>
#include <cstdint>

namespace hgs {

inline constexpr int BLOCK = 256;       // rows that share one entry of `block_bounds`
inline constexpr int N_PARAMETERS = 8;  // centre xyz, rgb, log radius, logit opacity
inline constexpr int N_NORMAL = 3;      // of a disc: its unit normal, in the world
inline constexpr float NEAR_M = 0.1f;
inline constexpr float MIN_ALPHA = 1.0f / 255.0f;
inline constexpr float MAX_ALPHA = 0.99f;
inline constexpr float MIN_TRANSMITTANCE = 1e-4f;
inline constexpr float BEHIND_M = 0.3f;  // optimising ends so far behind the farthest depth of the target
inline constexpr float WIDEST_TANGENT = 1.3f;  // of J, in units of the image's
inline constexpr float MIN_COVERED = 0.05f;  // below this A, C/A and D/A say nothing and are not compared

struct PinholeCamera {
  float fx, fy, cx, cy;
  int width, height;
  float rotation[9];     // p_camera = rotation p_world + translation
  float translation[3];
  float low_pass_px2;    // what a pixel's width adds to a splat's variance
  float far_m = __builtin_inff();  // Gaussians at this depth and beyond are not drawn
};

// Up to which |x / z| and |y / z| J of a disc is that of its own place.
struct Tangents {
  float x, y;
};

[[gnu::always_inline]] inline Tangents widest_tangents(const PinholeCamera& camera) {
  const float right = static_cast<float>(camera.width) - camera.cx;
  const float below = static_cast<float>(camera.height) - camera.cy;
  return {WIDEST_TANGENT * (camera.cx > right ? camera.cx : right) / camera.fx,
          WIDEST_TANGENT * (camera.cy > below ? camera.cy : below) / camera.fy};
}

struct GaussianRows {
  const float* parameters;    // (n, 8)
  std::size_t n;
  const float* block_bounds;  // (n_blocks, 6): lower, upper corner; contains centre -+ radius of every row
  const float* normals;       // (n, 3) of discs; null: the Gaussians are isotropic
};

struct ImageSums {
  float* colour;      // (h, w, 3)
  float* depth;       // (h, w)
  float* silhouette;  // (h, w)
};

struct ImageGradients {
  const float* colour;      // (h, w, 3)
  const float* depth;       // (h, w)
  const float* silhouette;  // (h, w)
};

struct Target {
  const std::uint8_t* rgb;  // (h, w, 3)
  const float* depth;       // (h, w); 0: no measurement; +inf: nothing is nearer than the camera's far_m
  float colour_weight, depth_weight, silhouette_weight, free_weight;
};

struct AdamState {
  float* parameters;     // (n, 8)
  float* first_moment;   // (n, 8)
  float* second_moment;  // (n, 8)
  std::int32_t* steps;   // (n,)
  float* block_bounds;   // (n_blocks, 6), widened where a row leaves them
  float rates[N_PARAMETERS];
  float beta1, beta2, epsilon;
  float min_log_radius, max_log_radius;
  float *normals, *normal_first_moment, *normal_second_moment;  // (n, 3) of discs, else null
  float normal_rate;
};

struct LossSums {
  double total = 0.0;         // the loss that was differentiated
  double colour_l1 = 0.0;     // mean over covered pixels
  double depth_l1_m = 0.0;    // mean over covered pixels
  std::int64_t pixels = 0;    // with a valid depth
  std::int64_t covered = 0;   // of those, with A > MIN_COVERED
};

// Where the time of one step of optimisation goes, and how much arithmetic its loops do.
struct StageTimes {
  double prepare_s = 0.0;   // projection, culling, sort, lists by tile
  double forward_s = 0.0;   // the forward sweep of every tile
  double backward_s = 0.0;  // the loss and the backward sweep of every tile
  double step_s = 0.0;      // from sums over pixels to parameters, and Adam
  double evaluations = 0.0;  // (splat, pixel) pairs in the patches that a sweep goes over
};

// Floating-point operations of one evaluation in the inner loops, a multiply-add counted as two.
inline constexpr double FORWARD_OPERATIONS = 11.0;   // a, w, T: 3; C and D: 4 multiply-adds
inline constexpr double BACKWARD_OPERATIONS = 33.0;  // a, w, T, S, qw: 5; q: 4 multiply-adds; 1 / (1 - alpha): 4; P: 3;
                                                     // its sums: 5 would do; those of colour and depth: 4 multiply-adds

// Of one kind of Gaussians.
struct RasteriseKernels {
  // `surface`: a depth image of the same camera, or null; what it hides (see TileLimits) is left out.
  void (*forward)(const GaussianRows&, const PinholeCamera&, const float* surface, const ImageSums&);
  // Adds to `gradient` (n, 8), and to `normal_gradient` (n, 3) of discs.
  void (*backward)(const GaussianRows&, const PinholeCamera&, const ImageGradients&, float* gradient,
                   float* normal_gradient);
  // The same work as `optimise` in separate, timed passes.
  StageTimes (*stages)(const GaussianRows&, const PinholeCamera&, const Target&, const AdamState&);
  LossSums (*optimise)(const GaussianRows&, const PinholeCamera&, const Target&, const AdamState&);
  // Adds to `information` (n, 8), `weight` times what each pixel holds.
  void (*information)(const GaussianRows&, const PinholeCamera&, const float* surface, float weight,
                      float* information);
  void (*quality_image)(const GaussianRows&, const PinholeCamera&, const float* information, const float* prior,
                        float* image);
};

}  // namespace hgs

// What one ray meets, front to back, and what it scores: blended and differentiated as the rasteriser does it.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "fisher_rays.hpp"
#include "rasterise_disc_slopes.hpp"
#include "rasterise_looks.hpp"
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

inline constexpr int MAX_LAYERS = 512;  // on one ray; it ends there
inline constexpr float LIGHT_LEFT = 0.003f;  // scores go by its square: what lies deeper adds nothing to speak of
inline constexpr float LN_TO_LOG2 = 1.44269504f;

typedef float Quad __attribute__((vector_size(16)));
typedef float QuadMemory __attribute__((vector_size(16), aligned(4), may_alias));

// What a ray meets: in the order of coming across it, and front to back.
struct Layers {
  float unclamped[MAX_LAYERS];  // o exp(-d^2 / 2 sigma^2)
  std::uint32_t row[MAX_LAYERS];
  std::uint64_t order[MAX_LAYERS];  // (bits of the depth, which is positive) << 32 | place in the lists above
  int n = 0;
  int passed = 0;  // of `order`: light went through; the rest waits, sorted as far as `sorted`
  int sorted = 0;
  float T = 1.0f;
  // Of those that light went through, padded to whole vectors:
  alignas(64) float depth[MAX_LAYERS + LANES];
  alignas(64) float alpha[MAX_LAYERS + LANES];       // not clamped
  alignas(64) float weight[MAX_LAYERS + LANES];
  alignas(64) float of_opacity[MAX_LAYERS + LANES];  // sum over channels of (alpha dC/dalpha)^2
  alignas(64) std::int32_t row_of[MAX_LAYERS + LANES];
};

struct RayLine {
  float x, y, z;  // where it starts
  float cosine, sine, tangent;
  std::uint32_t stamp;
};

// A ray is the pixel (0, -tangent) of a level camera of focal length 1 that looks along its azimuth; discs as that
// camera sees them, from their place (u, v), their depth and their normals in the world.
HGS_INLINE DiscLook disc_on_ray(const RayLine& line, const FisherRule& rule, const Vector3<VFloat>& normal, VFloat u,
                                VFloat v, VFloat depth, VFloat radius) {
  const VFloat size = radius / depth;
  const LaneDisc disc{normal.x * line.sine - normal.y * line.cosine, -normal.z,
                      normal.x * line.cosine + normal.y * line.sine, held(u, rule.widest.x), held(v, rule.widest.y), size,
                      size, radius};
  return look_of(disc, splat_all(rule.low_pass), VFloat{});
}

// d' Q d of the ray, for LANES Gaussians of a bundle from `base` on: at `depth`, `aside` and `below` of the ray [m].
template <class Shape>
HGS_INLINE VFloat square_on_ray(std::uint32_t bundle, int base, const FisherCells& cells, const FisherRule& rule,
                                const RayLine& line, VFloat depth, VFloat aside, VFloat below) {
  const VFloat radius2 = load(cells.bundles[bundle].radius2 + base);
  if constexpr (std::is_same_v<Shape, Isotropic>) {
    return (aside * aside + below * below) / (radius2 + rule.low_pass * depth * depth);
  } else {
    const BundleNormals& normals = cells.bundle_normals[bundle];
    const VFloat inverse = 1.0f / vmax(depth, splat_all(NEAR_M));
    const VFloat u = aside * inverse, dy = -below * inverse;
    const DiscLook look = disc_on_ray(line, rule, {load(normals.x + base), load(normals.y + base), load(normals.z + base)},
                                      u, -line.tangent - dy, vmax(depth, splat_all(NEAR_M)), vsqrt(radius2));
    const VFloat h = -u - look.lean * dy;
    return (1.0f / HALF_LOG2_E) * (look.across * h * h + look.down * dy * dy);
  }
}

// Appends the Gaussians of a bundle that the ray meets.
template <class Shape>
HGS_INLINE void meet(std::uint32_t which, const FisherCells& cells, const FisherRule& rule, const RayLine& line,
                     Layers& layers) {
  const Bundle& bundle = cells.bundles[which];
  for (int base = 0; base < BUNDLE; base += LANES) {
    const VFloat x = load(bundle.x + base) - line.x, y = load(bundle.y + base) - line.y;
    const VFloat depth = x * line.cosine + y * line.sine, aside = x * line.sine - y * line.cosine;
    const VFloat below = depth * line.tangent - (load(bundle.z + base) - line.z);
    const VFloat decay = load(bundle.decay + base);
    const VFloat square = square_on_ray<Shape>(which, base, cells, rule, line, depth, aside, below);
    std::uint32_t lanes = lane_bits((square <= decay) & (depth > NEAR_M) & (depth < rule.range));
    if (lanes == 0 || layers.n > MAX_LAYERS - LANES) continue;
    // a = o exp(-d' Q d / 2) = exp((decay - d' Q d) / 2) / 255
    const VFloat unclamped = vexp2((0.5f * LN_TO_LOG2) * (decay - square)) * (1.0f / 255.0f);
    alignas(64) std::int32_t depths[LANES];
    alignas(64) float alphas[LANES];
    store(depths, (VInt)depth);
    store(alphas, unclamped);
    for (; lanes != 0; lanes &= lanes - 1) {
      const int lane = __builtin_ctz(lanes), at = layers.n++;
      const std::size_t row = bundle.row[base + lane];
      layers.order[at] = static_cast<std::uint64_t>(depths[lane]) << 32 | static_cast<std::uint32_t>(at);
      layers.unclamped[at] = alphas[lane];
      layers.row[at] = static_cast<std::uint32_t>(row);
      __builtin_prefetch(cells.parameters + N_PARAMETERS * row);
      __builtin_prefetch(cells.information + N_PARAMETERS * row);
    }
  }
}

HGS_INLINE void sort_waiting(Layers& layers) {
  std::uint64_t* const first = layers.order + layers.passed;
  for (std::uint64_t* next = layers.order + layers.sorted; next < layers.order + layers.n; ++next) {
    const std::uint64_t key = *next;
    std::uint64_t* at = next;
    for (; at > first && at[-1] > key; --at) *at = at[-1];
    *at = key;
  }
  layers.sorted = layers.n;
}

HGS_INLINE float depth_of(std::uint64_t key) {
  const auto bits = static_cast<std::uint32_t>(key >> 32);
  float depth;
  __builtin_memcpy(&depth, &bits, sizeof depth);
  return depth;
}

// Lets the light through what waits nearer than a depth. False when nothing is left of it.
HGS_INLINE bool pass_light(Layers& layers, float depth) {
  float T = layers.T;
  int i = layers.passed;
  for (; i < layers.n && T >= LIGHT_LEFT; ++i) {
    const float own_depth = depth_of(layers.order[i]);
    if (own_depth >= depth) break;
    const auto at = static_cast<std::uint32_t>(layers.order[i]);
    const float a = layers.unclamped[at], weight = (a < MAX_ALPHA ? a : MAX_ALPHA) * T;
    layers.depth[i] = own_depth;
    layers.alpha[i] = a;
    layers.weight[i] = weight;
    layers.row_of[i] = static_cast<std::int32_t>(layers.row[at]);
    T -= weight;
  }
  layers.passed = i;
  layers.T = T;
  return T >= LIGHT_LEFT;
}

// Fills `of_opacity`, front to back: what is still to come is the final colour less what has gone by.
HGS_INLINE void differentiate_by_opacity(const FisherCells& cells, Layers& layers) {
  Quad behind{};
  for (int i = 0; i < layers.passed; ++i) {
    const float* rgb = cells.parameters + N_PARAMETERS * static_cast<std::size_t>(layers.row_of[i]) + 3;
    behind += *reinterpret_cast<const QuadMemory*>(rgb) * layers.weight[i];
  }
  for (int i = 0; i < layers.passed; ++i) {
    const float* rgb = cells.parameters + N_PARAMETERS * static_cast<std::size_t>(layers.row_of[i]) + 3;
    const Quad own = *reinterpret_cast<const QuadMemory*>(rgb) * layers.weight[i];
    const float a = layers.alpha[i], ratio = a / (1.0f - a);
    behind -= own;
    const Quad slope = own - behind * ratio;
    const float E = slope[0] * slope[0] + slope[1] * slope[1] + slope[2] * slope[2];
    layers.of_opacity[i] = a <= MAX_ALPHA ? E : 0.0f;
  }
}

// de/dtheta on the ray, by moving a Gaussian to the right, down and forward in the camera that looks along its azimuth,
// and by the log radius; derivatives as in rasterise_slopes.hpp, at a focal length of 1.
struct RaySlopes {
  VFloat right, down, forward, radial;
};

// From the Gaussian's place (u, v), its depth and its radius.
HGS_INLINE RaySlopes ball_slopes(const RayLine& line, const FisherRule& rule, VFloat u, VFloat v, VFloat z,
                                 VFloat radius) {
  const VFloat inverse_z = 1.0f / z, size = radius * inverse_z, own_variance = size * size;
  const VFloat falloff = 0.5f / (own_variance + rule.low_pass);
  const VFloat dx = -u, dy = -line.tangent - v, d2 = dx * dx + dy * dy;
  const VFloat two_k = 2.0f * falloff, by_pixel = two_k * inverse_z;
  const VFloat radial = two_k * falloff * 2.0f * own_variance * d2;
  return {by_pixel * dx, by_pixel * dy, -inverse_z * (two_k * (u * dx + v * dy) + radial), radial};
}

HGS_INLINE RaySlopes disc_slopes(const RayLine& line, const FisherRule& rule, const Vector3<VFloat>& normal, VFloat u,
                                 VFloat v, VFloat z, VFloat log_radius) {
  // At the origin of its own frame.
  const PinholeCamera camera{1.0f, 1.0f, 0.0f, 0.0f, 0, 0, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {}, rule.low_pass};
  const DiscLook look = disc_on_ray(line, rule, normal, u, v, z, vexp(log_radius));
  const SeenDisc<VFloat> seen{u, v, z, look.across, look.lean, look.down, look.slope_h, look.slope_y, VFloat{}, log_radius,
                              {normal.x * line.sine - normal.y * line.cosine, -normal.z,
                               normal.x * line.cosine + normal.y * line.sine}};
  const VFloat dy = -line.tangent - v;
  const DiscExponent<VFloat> e = DiscSlopes<VFloat>(seen, camera, rule.widest).exponent(-u - look.lean * dy, dy);
  return {e.x, e.y, e.z, e.log_radius};
}

template <class Shape>
static FisherScore score_layers(const FisherCells& cells, const FisherRule& rule, const RayLine& line, Layers& layers) {
  differentiate_by_opacity(cells, layers);
  for (int i = layers.passed; i < layers.passed + LANES; ++i) {
    layers.row_of[i] = layers.row_of[0];
    layers.depth[i] = 1.0f;
    layers.weight[i] = layers.of_opacity[i] = 0.0f;
  }
  VFloat sideways{}, other{};
  const VInt all = VInt{} - 1;
  for (int base = 0; base < layers.passed; base += LANES) {
    const VInt offset = load(layers.row_of + base) * N_PARAMETERS;
    const auto parameter = [&](int k) HGS_LAMBDA { return gather(cells.parameters + k, offset, all); };
    const auto share = [&](int k) HGS_LAMBDA {
      return 1.0f / (gather(cells.information + k, offset, all) + rule.prior[k]);
    };
    const VFloat z = load(layers.depth + base), inverse_z = 1.0f / z;
    const VFloat x = parameter(0) - line.x, y = parameter(1) - line.y;
    const VFloat u = (x * line.sine - y * line.cosine) * inverse_z, v = (line.z - parameter(2)) * inverse_z;
    const VFloat opacity = 1.0f / (1.0f + vexp(-parameter(7)));
    RaySlopes slopes;
    if constexpr (std::is_same_v<Shape, Isotropic>) {
      slopes = ball_slopes(line, rule, u, v, z, vexp(parameter(6)));
    } else {
      const VInt place = load(layers.row_of + base) * N_NORMAL;
      const auto of_normal = [&](int k) HGS_LAMBDA { return gather(cells.normals + k, place, all); };
      slopes = disc_slopes(line, rule, {of_normal(0), of_normal(1), of_normal(2)}, u, v, z, parameter(6));
    }
    const VFloat right = slopes.right, down = slopes.down, forward = slopes.forward, radial = slopes.radial;
    const VFloat transparency = 1.0f - opacity, share_x = share(0), share_y = share(1);
    const VFloat of_side = right * right * (line.sine * line.sine * share_x + line.cosine * line.cosine * share_y);
    const VFloat both = 2.0f * line.sine * line.cosine * right * forward * (share_x - share_y);
    const VFloat of_rest = forward * forward * (line.cosine * line.cosine * share_x + line.sine * line.sine * share_y) +
                           both + down * down * share(2) + radial * radial * share(6) +
                           transparency * transparency * share(7);
    const VFloat weight = load(layers.weight + base);
    const VFloat of_colour = weight * weight * (share(3) + share(4) + share(5));
    const VFloat nearness = rule.saturation > 0.0f ? vmin(z * (1.0f / rule.saturation), splat_all(1.0f))
                                                   : splat_all(1.0f);
    const VFloat nearness2 = nearness * nearness, of_opacity = load(layers.of_opacity + base);
    sideways += nearness2 * of_opacity * of_side;
    other += nearness2 * (of_colour + of_opacity * of_rest);
  }
  FisherScore score{};
  for (int lane = 0; lane < LANES; ++lane) {
    score.sideways += sideways[lane];
    score.other += other[lane];
  }
  return score;
}

}  // namespace hgs::HGS_VARIANT

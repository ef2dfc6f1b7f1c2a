// The exact Fisher score along rays: sixteen Gaussians are tested at once, and what a ray meets is blended and
// differentiated as the rasteriser does it.
// Included only by the variant files (see simd.hpp).
//
// A ray is parametrised by depth (horizontal distance), by which splats are sorted. A bundle is listed in every cell that
// it reaches into and tested in the first of them; what lies deeper than the cell waits for a later one.
#pragma once
#include "fisher_rays.hpp"
#include "parameter_column_variant.hpp"
#include "rasterise.hpp"
#include "ray_walk_variant.hpp"
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

inline constexpr int MAX_LAYERS = 512;     // on one ray; it ends there
inline constexpr int MAX_CROSSINGS = 128;  // of cells that hold anything; a ray ends there
inline constexpr int CROSSINGS_AHEAD = 6;
inline constexpr int MAX_NEAR = 512;
inline constexpr float FAINTEST_LOGIT = -5.53733f;  // of an opacity of 1/255: nothing is drawn of it
inline constexpr float LN_TO_LOG2 = 1.44269504f;

typedef float Quad __attribute__((vector_size(16)));
typedef float QuadMemory __attribute__((vector_size(16), aligned(4), may_alias));

// Bits 0 and 1 of a number moved to bits 0 and 3.
HGS_INLINE VInt spread_bits(VInt a) { return (a & 1) | ((a & 2) << 2); }

static void list_cells(const float* parameters, std::int32_t n, const FisherGrid& grid, std::uint32_t* keys) {
  alignas(64) float centre[3][PADDED_BLOCK], logit[PADDED_BLOCK];
  for (int a = 0; a < 3; ++a) column_of(parameters, n, a, centre[a]);
  column_of(parameters, n, 7, logit);
  alignas(64) std::int32_t found[LANES];
  const float per_part = 4.0f / grid.size;
  for (std::int32_t i = 0; i < n; i += LANES) {
    VInt inside = load(logit + i) > FAINTEST_LOGIT;
    VInt cell[3], part{};
    for (int a = 0; a < 3; ++a) {
      const VFloat parts = splat_all(4.0f * static_cast<float>(grid.shape[a]));
      const VFloat at = (load(centre[a] + i) - grid.lower[a]) * per_part;
      inside &= (at >= 0.0f) & (at < parts);
      const VInt whole = to_int(inside ? at : VFloat{});
      cell[a] = whole >> 2;
      part |= spread_bits(whole & 3) << (2 - a);
    }
    const VInt index = (cell[0] * grid.shape[1] + cell[1]) * grid.shape[2] + cell[2];
    store(found, inside ? (index << 6) | part : VInt{} - 1);
    for (int lane = 0; lane < LANES && i + lane < n; ++lane) keys[i + lane] = static_cast<std::uint32_t>(found[lane]);
  }
}

static void make_bundle(const float* parameters, const std::uint32_t* rows, std::int32_t n, const FisherRule& rule,
                        Bundle& bundle, BundleBounds& bounds) {
  alignas(64) float log_radius[BUNDLE], logit[BUNDLE], reach[BUNDLE];
  for (int i = 0; i < BUNDLE; ++i) {
    const std::uint32_t row = rows[i < n ? i : n - 1];
    const float* p = parameters + N_PARAMETERS * static_cast<std::size_t>(row);
    bundle.x[i] = p[0];
    bundle.y[i] = p[1];
    bundle.z[i] = p[2];
    log_radius[i] = p[6];
    logit[i] = p[7];
    bundle.row[i] = row;
  }
  const float widest_low_pass = rule.low_pass * rule.range * rule.range;
  for (int i = 0; i < BUNDLE; i += LANES) {
    const VFloat radius = vexp(load(log_radius + i)), radius2 = radius * radius;
    const VFloat opacity = 1.0f / (1.0f + vexp(-load(logit + i)));
    const VFloat decay = 2.0f * vlog(vmax(opacity * 255.0f, splat_all(1.0f)));
    store(bundle.radius2 + i, radius2);
    store(bundle.decay + i, decay);
    store(reach + i, vsqrt(decay * (radius2 + widest_low_pass)));
  }
  for (int i = n; i < BUNDLE; ++i) bundle.decay[i] = -1.0f;
  const float* centres[3] = {bundle.x, bundle.y, bundle.z};
  for (int a = 0; a < 3; ++a) {
    const float* c = centres[a];
    float low = c[0], high = c[0];
    bounds.low[a] = c[0] - reach[0];
    bounds.high[a] = c[0] + reach[0];
    for (int i = 1; i < n; ++i) {
      low = c[i] < low ? c[i] : low;
      high = c[i] > high ? c[i] : high;
      bounds.low[a] = c[i] - reach[i] < bounds.low[a] ? c[i] - reach[i] : bounds.low[a];
      bounds.high[a] = c[i] + reach[i] > bounds.high[a] ? c[i] + reach[i] : bounds.high[a];
    }
    bounds.centre[a] = 0.5f * (low + high);
  }
  bounds.radius = 0.0f;
  for (int i = 0; i < n; ++i) {
    float d2 = 0.0f;
    for (int a = 0; a < 3; ++a) d2 += (centres[a][i] - bounds.centre[a]) * (centres[a][i] - bounds.centre[a]);
    const float radius = __builtin_sqrtf(d2) + reach[i];
    bounds.radius = radius > bounds.radius ? radius : bounds.radius;
  }
}

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

// Appends the Gaussians of a bundle that the ray meets.
HGS_INLINE void meet(const Bundle& bundle, const FisherCells& cells, const FisherRule& rule, const RayLine& line,
                     Layers& layers) {
  for (int base = 0; base < BUNDLE; base += LANES) {
    const VFloat x = load(bundle.x + base) - line.x, y = load(bundle.y + base) - line.y;
    const VFloat depth = x * line.cosine + y * line.sine, aside = x * line.sine - y * line.cosine;
    const VFloat below = depth * line.tangent - (load(bundle.z + base) - line.z);
    const VFloat decay = load(bundle.decay + base);
    const VFloat variance = load(bundle.radius2 + base) + rule.low_pass * depth * depth;
    const VFloat d2 = aside * aside + below * below;
    std::uint32_t lanes = lane_bits((d2 <= decay * variance) & (depth > NEAR_M) & (depth < rule.range));
    if (lanes == 0 || layers.n > MAX_LAYERS - LANES) continue;
    // a = o exp(-d^2 / 2 sigma^2) = exp((decay - d^2 / sigma^2) / 2) / 255
    const VFloat unclamped = vexp2((0.5f * LN_TO_LOG2) * (decay - d2 / variance)) * (1.0f / 255.0f);
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
  for (; i < layers.n && T >= MIN_TRANSMITTANCE; ++i) {
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
  return T >= MIN_TRANSMITTANCE;
}

// The cells with bundles that a ray comes through, in order, and at what depth it leaves each.
struct Crossings {
  std::uint32_t cell[MAX_CROSSINGS];
  float leave[MAX_CROSSINGS];
  int n = 0;
};

// For up to LANES rays.
static void list_crossings(const FisherCells& cells, const FisherRule& rule, const FisherRays& rays, int first, int n,
                           Crossings* crossings) {
  const FisherGrid& grid = cells.grid;
  const float per_cell = 1.0f / grid.size, reach = rule.range * per_cell;
  alignas(64) float direction[3][LANES] = {};
  for (int lane = 0; lane < n; ++lane) {
    direction[0][lane] = rays.cosine[first + lane] * reach;
    direction[1][lane] = rays.sine[first + lane] * reach;
    direction[2][lane] = rays.tangent[first + lane] * reach;
    crossings[lane].n = 0;
  }
  float from[3];
  for (int a = 0; a < 3; ++a) from[a] = (rays.from[a] - grid.lower[a]) * per_cell;
  const VFloat dx = load(direction[0]), dy = load(direction[1]);
  RayWalk walk(from, dx, dy, load(direction[2]), grid.shape, VFloat{} + NEAR_M / rule.range,
               (dx * dx + dy * dy > 0.0f) ? splat_all(1.0f) : splat_all(-1.0f));
  alignas(64) float leave[LANES];
  alignas(64) std::int32_t index[LANES];
  while (any(walk.active)) {
    const VFloat t_leave = walk.t_leave();
    const VInt cell = walk.cell(grid.shape);
    const VInt end = (VInt)gather(reinterpret_cast<const float*>(cells.end), cell, walk.active);
    std::uint32_t lanes = lane_bits(end != 0);
    if (lanes != 0) {
      store(leave, t_leave * rule.range);
      store(index, cell);
      for (; lanes != 0; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        Crossings& crossing = crossings[lane];
        if (crossing.n == MAX_CROSSINGS) continue;
        crossing.cell[crossing.n] = static_cast<std::uint32_t>(index[lane]);
        crossing.leave[crossing.n] = leave[lane];
        ++crossing.n;
      }
    }
    walk.advance(t_leave, grid.shape);
  }
}

// Bundles that a ray comes near to, in the order of the crossings in which it first does so.
struct NearBundles {
  std::uint32_t bundle[MAX_NEAR];
  int n = 0;
};

// Appends the bundles of a list that this ray has not come near to before. At equal depth, a Gaussian of a bundle is at
// most 1 / cos(elevation) farther from the ray than from the bundle's centre when that lies on it.
HGS_INLINE void find_bundles(const FisherCells& cells, const BundleList& list, const RayLine& line, RayStamps& stamps,
                             NearBundles& near) {
  const float stretch2 = 1.0f + line.tangent * line.tangent;
  for (int base = 0; base < BUNDLE; base += LANES) {
    const VFloat x = load(list.x + base) - line.x, y = load(list.y + base) - line.y;
    const VFloat depth = x * line.cosine + y * line.sine, aside = x * line.sine - y * line.cosine;
    const VFloat below = depth * line.tangent - (load(list.z + base) - line.z);
    const VFloat radius = load(list.radius + base);
    const VInt within = (aside * aside + below * below <= stretch2 * radius * radius) & (radius >= 0.0f);
    for (std::uint32_t lanes = lane_bits(within); lanes != 0; lanes &= lanes - 1) {
      const std::uint32_t bundle = list.bundle[base + __builtin_ctz(lanes)];
      if (stamps.of_bundle[bundle] == line.stamp) continue;
      stamps.of_bundle[bundle] = line.stamp;
      near.bundle[near.n++] = bundle;
      const char* bytes = reinterpret_cast<const char*>(cells.bundles + bundle);
      for (std::size_t offset = 0; offset < sizeof(Bundle); offset += 64) __builtin_prefetch(bytes + offset);
    }
  }
}

// What memory holds of the map comes slowly: the first cells of many rays are looked up before the first ray is
// followed, and what they hold is on its way meanwhile.
struct LookAhead {
  NearBundles near;
  int end[CROSSINGS_AHEAD];  // of each crossing's bundles
  int n = 0;                 // crossings that were looked up
};

HGS_INLINE void look_ahead(const FisherCells& cells, const Crossings& crossings, const RayLine& line, RayStamps& stamps,
                           LookAhead& ahead) {
  ahead.near.n = ahead.n = 0;
  for (int c = 0; c < crossings.n && c < CROSSINGS_AHEAD; ++c) {
    const std::uint32_t begin = cells.begin[crossings.cell[c]], end = cells.end[crossings.cell[c]];
    if (ahead.near.n + BUNDLE * (end - begin) > MAX_NEAR) return;
    for (std::uint32_t l = begin; l < end; ++l) find_bundles(cells, cells.lists[l], line, stamps, ahead.near);
    ahead.end[ahead.n++] = ahead.near.n;
  }
}

// Everything of which some light comes back, front to back.
HGS_INLINE void collect_layers(const FisherCells& cells, const FisherRule& rule, const RayLine& line,
                               const Crossings& crossings, const LookAhead& ahead, RayStamps& stamps, Layers& layers) {
  layers.n = layers.passed = layers.sorted = 0;
  layers.T = 1.0f;
  int met = 0;
  for (int c = 0; c < crossings.n; ++c) {
    if (c < ahead.n) {
      for (; met < ahead.end[c]; ++met) meet(cells.bundles[ahead.near.bundle[met]], cells, rule, line, layers);
    } else {
      // Other rays have stamped bundles since those of this one were found.
      for (int i = 0; c == ahead.n && i < ahead.near.n; ++i) stamps.of_bundle[ahead.near.bundle[i]] = line.stamp;
      const std::uint32_t cell = crossings.cell[c];
      for (std::uint32_t l = cells.begin[cell]; l < cells.end[cell]; ++l) {
        NearBundles near;
        find_bundles(cells, cells.lists[l], line, stamps, near);
        for (int i = 0; i < near.n; ++i) meet(cells.bundles[near.bundle[i]], cells, rule, line, layers);
      }
    }
    if (layers.passed == layers.n) continue;
    sort_waiting(layers);
    if (!pass_light(layers, crossings.leave[c])) return;
  }
  pass_light(layers, rule.range);
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

// Derivatives as in rasterise_chain.hpp, at a focal length of 1.
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
    const VFloat size = vexp(parameter(6)) * inverse_z, own_variance = size * size;
    const VFloat falloff = 0.5f / (own_variance + rule.low_pass);
    const VFloat opacity = 1.0f / (1.0f + vexp(-parameter(7)));
    const VFloat dx = -u, dy = -line.tangent - v, d2 = dx * dx + dy * dy;
    const VFloat two_k = 2.0f * falloff, by_pixel = two_k * inverse_z;
    const VFloat radial = two_k * falloff * 2.0f * own_variance * d2;  // by log radius
    const VFloat right = by_pixel * dx, down = by_pixel * dy;
    const VFloat forward = -inverse_z * (two_k * (u * dx + v * dy) + radial);
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

static void first_cells(const FisherCells& cells, const FisherRule& rule, const FisherRays& rays,
                        std::uint32_t* first) {
  Crossings crossings[LANES];
  for (int base = 0; base < rays.n; base += LANES) {
    const int n = rays.n - base < LANES ? rays.n - base : LANES;
    list_crossings(cells, rule, rays, base, n, crossings);
    for (int i = 0; i < n; ++i) first[base + i] = crossings[i].n == 0 ? NO_CELL : crossings[i].cell[0];
  }
}

static void score_rays(const FisherCells& cells, const FisherRule& rule, const FisherRays& rays, RayStamps& stamps,
                       FisherScore* scores) {
  Layers layers;
  Crossings crossings[LANES];
  LookAhead ahead[LANES];
  RayLine lines[LANES];
  for (int first = 0; first < rays.n; first += LANES) {
    const int n = rays.n - first < LANES ? rays.n - first : LANES;
    list_crossings(cells, rule, rays, first, n, crossings);
    for (int i = 0; i < n; ++i) {
      const int r = first + i;
      lines[i] = {rays.from[0], rays.from[1], rays.from[2], rays.cosine[r], rays.sine[r], rays.tangent[r],
                  ++stamps.ray};
      for (int c = 0; c < crossings[i].n && c < CROSSINGS_AHEAD; ++c) {
        const BundleList* lists = cells.lists + cells.begin[crossings[i].cell[c]];
        const char* bytes = reinterpret_cast<const char*>(lists);
        for (std::size_t offset = 0; offset < sizeof(BundleList); offset += 64) __builtin_prefetch(bytes + offset);
      }
    }
    for (int i = 0; i < n; ++i) look_ahead(cells, crossings[i], lines[i], stamps, ahead[i]);
    for (int i = 0; i < n; ++i) {
      collect_layers(cells, rule, lines[i], crossings[i], ahead[i], stamps, layers);
      scores[first + i] = layers.passed == 0 ? FisherScore{} : score_layers(cells, rule, lines[i], layers);
    }
  }
}

}  // namespace hgs::HGS_VARIANT

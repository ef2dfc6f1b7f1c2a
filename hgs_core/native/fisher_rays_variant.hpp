// The exact Fisher score along rays: where they go, which bundles they come near to, and in what order.
// Included only by the variant files (see simd.hpp).
//
// A ray is parametrised by depth (horizontal distance), by which splats are sorted. A bundle is listed in every cell that
// it reaches into and tested in the first of them; what lies deeper than the cell waits for a later one.
#pragma once
#include "fisher_layers_variant.hpp"
#include "ray_walk_variant.hpp"

namespace hgs::HGS_VARIANT {

inline constexpr int MAX_CROSSINGS = 128;  // of cells that hold anything; a ray ends there
inline constexpr int CROSSINGS_AHEAD = 6;
inline constexpr int MAX_NEAR = 512;

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
template <class Shape>
HGS_INLINE void collect_layers(const FisherCells& cells, const FisherRule& rule, const RayLine& line,
                               const Crossings& crossings, const LookAhead& ahead, RayStamps& stamps, Layers& layers) {
  layers.n = layers.passed = layers.sorted = 0;
  layers.T = 1.0f;
  int met = 0;
  for (int c = 0; c < crossings.n; ++c) {
    if (c < ahead.n) {
      for (; met < ahead.end[c]; ++met) meet<Shape>(ahead.near.bundle[met], cells, rule, line, layers);
    } else {
      // Other rays have stamped bundles since those of this one were found.
      for (int i = 0; c == ahead.n && i < ahead.near.n; ++i) stamps.of_bundle[ahead.near.bundle[i]] = line.stamp;
      const std::uint32_t cell = crossings.cell[c];
      for (std::uint32_t l = cells.begin[cell]; l < cells.end[cell]; ++l) {
        NearBundles near;
        find_bundles(cells, cells.lists[l], line, stamps, near);
        for (int i = 0; i < near.n; ++i) meet<Shape>(near.bundle[i], cells, rule, line, layers);
      }
    }
    if (layers.passed == layers.n) continue;
    sort_waiting(layers);
    if (!pass_light(layers, crossings.leave[c])) return;
  }
  pass_light(layers, rule.range);
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

template <class Shape>
static void score_rays_of(const FisherCells& cells, const FisherRule& rule, const FisherRays& rays, RayStamps& stamps,
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
      collect_layers<Shape>(cells, rule, lines[i], crossings[i], ahead[i], stamps, layers);
      scores[first + i] = layers.passed == 0 ? FisherScore{} : score_layers<Shape>(cells, rule, lines[i], layers);
    }
  }
}

static void score_rays(const FisherCells& cells, const FisherRule& rule, const FisherRays& rays, RayStamps& stamps,
                       FisherScore* scores) {
  const auto score = cells.normals == nullptr ? score_rays_of<Isotropic> : score_rays_of<Disc>;
  score(cells, rule, rays, stamps, scores);
}

}  // namespace hgs::HGS_VARIANT

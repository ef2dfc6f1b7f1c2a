// The exact score of Eq. 9 along a sample of the rays of a 360-degree panorama.
//
//   score of a view = sum over its pixels of  sum_ik (dC/dw_ik)^2 / (I_ik + prior)
//
// (the sums over pixels in H_cand and over Gaussians may be exchanged). A sampled ray stands for the pixels around it:
// it is drawn as the middle column of a level camera that looks along its azimuth, with every splat at that camera's
// resolution, so nothing is lost to a coarse image; what a sample misses is a matter of chance, not of size.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "gain_kernels.hpp"
#include "variants.hpp"

namespace hgs {

namespace {

// A splat on a ray.
struct Layer {
  float alpha, weight, unclamped;
  float dx, dy, d2;                // from the splat to the pixel [px]
  float u, v, depth;               // the splat on the screen, relative to the optical axis [px], [m]
  float falloff, own_variance;     // 1 / (2 sigma^2), (f r / z)^2
  float opacity;
  const float* parameters;
  const float* information;
};

struct Ray {
  float cosine, sine;  // of its azimuth
  float v;             // its pixel, relative to the optical axis [px]
};

constexpr int MAX_LAYERS = 512;

std::size_t row_of(std::uint64_t key) { return key & 0xffffffffu; }

// The splats that count, front to back, until nothing is left of the light.
int layers_of(const std::uint64_t* first, const std::uint64_t* last, const Ray& ray, const float* from, const InformedMap& map,
              const FisherRule& rule, Layer* layers) {
  int n = 0;
  float T = 1.0f;
  for (const std::uint64_t* hit = first; hit != last && n < MAX_LAYERS && T >= MIN_TRANSMITTANCE; ++hit) {
    const std::size_t row = row_of(*hit);
    const float* p = map.parameters + N_PARAMETERS * row;
    const float x = p[0] - from[0], y = p[1] - from[1], z = p[2] - from[2];
    Layer& layer = layers[n];
    layer.depth = x * ray.cosine + y * ray.sine;
    if (layer.depth <= NEAR_M) continue;
    const float f_over_z = rule.focal_px / layer.depth, size = f_over_z * std::exp(p[6]);
    layer.u = f_over_z * (x * ray.sine - y * ray.cosine);
    layer.v = -f_over_z * z;
    layer.own_variance = size * size;
    layer.falloff = 0.5f / (layer.own_variance + rule.low_pass_px2);
    layer.dx = -layer.u;
    layer.dy = ray.v - layer.v;
    layer.d2 = layer.dx * layer.dx + layer.dy * layer.dy;
    layer.opacity = 1.0f / (1.0f + std::exp(-p[7]));
    layer.unclamped = layer.opacity * std::exp(-layer.falloff * layer.d2);
    if (layer.unclamped < MIN_ALPHA) continue;
    layer.alpha = std::min(layer.unclamped, MAX_ALPHA);
    layer.weight = layer.alpha * T;
    layer.parameters = p;
    layer.information = map.information + N_PARAMETERS * row;
    T -= layer.weight;
    ++n;
  }
  return n;
}

// sum_ik (dC/dw_ik)^2 / (I_ik + prior); derivatives as in rasterise_chain.hpp.
double score_of(const Layer* layers, int n, const Ray& ray, const FisherRule& rule) {
  float behind[3] = {};  // colour still to come
  for (int i = 0; i < n; ++i) {
    for (int c = 0; c < 3; ++c) behind[c] += layers[i].parameters[3 + c] * layers[i].weight;
  }
  double score = 0.0;
  for (int i = 0; i < n; ++i) {
    const Layer& layer = layers[i];
    const float* H = layer.information;
    const float nearness = std::min(1.0f, layer.depth / std::max(rule.saturation_m, layer.depth));
    const float ratio = layer.alpha / (1.0f - layer.alpha);
    float E = 0.0f, of_colour = 0.0f;  // sum over channels of (alpha dC/dalpha)^2
    for (int c = 0; c < 3; ++c) {
      const float own = layer.parameters[3 + c] * layer.weight;
      behind[c] -= own;
      const float slope = own - behind[c] * ratio;
      E += slope * slope;
      of_colour += layer.weight * layer.weight / (H[3 + c] + rule.prior);
    }
    score += nearness * nearness * of_colour;
    if (layer.unclamped > MAX_ALPHA) continue;
    const float two_k = 2.0f * layer.falloff, inverse_z = 1.0f / layer.depth;
    const float by_pixel = two_k * rule.focal_px * inverse_z;
    const float by_variance = two_k * layer.falloff * 2.0f * layer.own_variance;
    const float right = by_pixel * layer.dx, down = by_pixel * layer.dy;
    const float forward =
        -inverse_z * (two_k * (layer.u * layer.dx + layer.v * layer.dy) + by_variance * layer.d2);
    const float x = right * ray.sine + forward * ray.cosine, y = -right * ray.cosine + forward * ray.sine, z = -down;
    const float radius = by_variance * layer.d2, opacity = 1.0f - layer.opacity;
    score += nearness * nearness * E * (x * x / (H[0] + rule.prior) + y * y / (H[1] + rule.prior) +
                                        z * z / (H[2] + rule.prior) +
                                        radius * radius / (H[6] + rule.prior) +
                                        opacity * opacity / (H[7] + rule.prior));
  }
  return score;
}

// All hits of one viewpoint, grouped by ray and sorted by depth.
class HitLists {
 public:
  // `bounds` are those of the first blocks; there may be room for more.
  void collect(const std::vector<RayBlock>& blocks, const std::vector<const float*>& bounds, const float* from,
               const RayGrid& grid) {
    std::int64_t n = 0;
    for (std::size_t b = 0; b < bounds.size(); ++b) {
      const float dx = std::max({bounds[b][0] - from[0], 0.0f, from[0] - bounds[b][3]});
      const float dy = std::max({bounds[b][1] - from[1], 0.0f, from[1] - bounds[b][4]});
      if (dx * dx + dy * dy > grid.range * grid.range) continue;
      for (;;) {
        const std::int64_t room = static_cast<std::int64_t>(hits_.size()) - n;
        const std::int64_t more = room == 0 ? -1
                                            : variant_kernels().gain.hit_rays(blocks[b], from, grid, hits_.data() + n, room);
        if (more >= 0) {
          n += more;
          break;
        }
        hits_.resize(2 * hits_.size() + 4096);
      }
    }
    const std::size_t n_rays = static_cast<std::size_t>(grid.n_azimuth) * grid.n_elevation;
    begin_.assign(n_rays + 1, 0);
    for (std::int64_t k = 0; k < n; ++k) ++begin_[hits_[k].ray + 1];
    for (std::size_t ray = 0; ray < n_rays; ++ray) begin_[ray + 1] += begin_[ray];
    grouped_.resize(static_cast<std::size_t>(n));
    std::vector<std::uint32_t> at(begin_.begin(), begin_.end() - 1);
    for (std::int64_t k = 0; k < n; ++k) grouped_[at[hits_[k].ray]++] = hits_[k].key;
    for (std::size_t ray = 0; ray < n_rays; ++ray) sort(grouped_.data() + begin_[ray], grouped_.data() + begin_[ray + 1]);
  }
  const std::uint64_t* begin(std::size_t ray) const { return grouped_.data() + begin_[ray]; }
  const std::uint64_t* end(std::size_t ray) const { return grouped_.data() + begin_[ray + 1]; }

 private:
  static void sort(std::uint64_t* first, std::uint64_t* last) {
    if (last - first > 64) {
      std::sort(first, last);
      return;
    }
    for (std::uint64_t* next = first + 1; next < last; ++next) {
      const std::uint64_t key = *next;
      std::uint64_t* at = next;
      for (; at > first && at[-1] > key; --at) *at = at[-1];
      *at = key;
    }
  }

  std::vector<RayHit> hits_;
  std::vector<std::uint64_t> grouped_;
  std::vector<std::uint32_t> begin_;
};

// The rows of a ray's hits will be needed soon, and lie anywhere.
void fetch(const std::uint64_t* first, const std::uint64_t* last, const InformedMap& map) {
  for (const std::uint64_t* hit = first; hit != last; ++hit) {
    __builtin_prefetch(map.parameters + N_PARAMETERS * row_of(*hit));
    __builtin_prefetch(map.information + N_PARAMETERS * row_of(*hit));
  }
}

}  // namespace

void sample_fisher(const InformedMap& map, const double* positions, std::int64_t n_positions, const Panorama& panorama,
                   const FisherRule& rule, float* score) {
  const double d_phi = 2.0 * std::numbers::pi / panorama.n_azimuth;
  const double d_tan = (panorama.tan_high - panorama.tan_low) / panorama.n_elevation;
  std::vector<float> stagger;
  for (std::int64_t row = 0; row < panorama.n_elevation; ++row) stagger.push_back(static_cast<float>(row_stagger(row)));
  const RayGrid grid{static_cast<std::int32_t>(panorama.n_azimuth),
                     static_cast<std::int32_t>(panorama.n_elevation),
                     static_cast<float>(panorama.tan_low),
                     static_cast<float>(d_tan),
                     static_cast<float>(d_phi),
                     stagger.data(),
                     static_cast<float>(panorama.range),
                     rule.focal_px,
                     rule.low_pass_px2};
  std::vector<const float*> bounds;
  std::vector<std::int64_t> first_rows;
  for (std::int64_t first = 0; first < map.n; first += BLOCK) {
    const float* box = map.block_bounds + 6 * (first / BLOCK);
    for (std::int64_t i = 0; i < n_positions; ++i) {
      const double* from = positions + 3 * i;
      const double dx = std::max({box[0] - from[0], 0.0, from[0] - box[3]});
      const double dy = std::max({box[1] - from[1], 0.0, from[1] - box[4]});
      if (dx * dx + dy * dy > panorama.range * panorama.range) continue;
      bounds.push_back(box);
      first_rows.push_back(first);
      break;
    }
  }
  static thread_local std::vector<RayBlock> scratch;  // its pages cost more than the work done in them
  scratch.resize(std::max(scratch.size(), bounds.size()));
  std::vector<RayBlock>& blocks = scratch;
  const auto n_blocks = static_cast<std::int64_t>(bounds.size());
#pragma omp parallel
  {
#pragma omp for schedule(static)
    for (std::int64_t b = 0; b < n_blocks; ++b) {
      const auto n = static_cast<std::int32_t>(std::min<std::int64_t>(BLOCK, map.n - first_rows[b]));
      variant_kernels().gain.prepare_ray_block(map.parameters + N_PARAMETERS * first_rows[b], n, blocks[b]);
      blocks[b].first_row = static_cast<std::uint32_t>(first_rows[b]);
    }
    static thread_local HitLists hits;
    std::vector<Layer> layers(MAX_LAYERS);
#pragma omp for schedule(dynamic, 1)
    for (std::int64_t i = 0; i < n_positions; ++i) {
      const float from[3] = {static_cast<float>(positions[3 * i]), static_cast<float>(positions[3 * i + 1]),
                             static_cast<float>(positions[3 * i + 2])};
      hits.collect(blocks, bounds, from, grid);
      const std::int64_t n_bins = panorama.n_elevation * panorama.n_azimuth;
      for (std::int64_t row = 0; row < panorama.n_elevation; ++row) {
        for (std::int64_t column = 0; column < panorama.n_azimuth; ++column) {
          const std::int64_t bin = row * panorama.n_azimuth + column;
          if (bin + 2 < n_bins) fetch(hits.begin(bin + 2), hits.end(bin + 2), map);
          const double phi = (column + row_stagger(row)) * d_phi - std::numbers::pi;
          const Ray ray{static_cast<float>(std::cos(phi)), static_cast<float>(std::sin(phi)),
                        static_cast<float>(-rule.focal_px * (panorama.tan_low + (row + 0.5) * d_tan))};
          const int n = layers_of(hits.begin(bin), hits.end(bin), ray, from, map, rule, layers.data());
          score[i * panorama.n_elevation * panorama.n_azimuth + bin] =
              static_cast<float>(score_of(layers.data(), n, ray, rule));
        }
      }
    }
  }
}

}  // namespace hgs

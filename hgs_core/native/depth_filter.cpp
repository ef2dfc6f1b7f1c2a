#include "depth_filter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hgs {

namespace {
constexpr float kInfinity = std::numeric_limits<float>::infinity();
inline bool measured(float z) { return z > 0.0f && z < kInfinity; }
}  // namespace

void halve_frame(const std::uint8_t* rgb, const float* depth, int width, int height, float edge_m,
                 std::uint8_t* rgb_half, float* depth_half) {
  const int half_width = width / 2, half_height = height / 2;
#pragma omp parallel for schedule(static)
  for (int y = 0; y < half_height; ++y) {
    for (int x = 0; x < half_width; ++x) {
      const long first = long(2 * y) * width + 2 * x;
      const long pixels[4] = {first, first + 1, first + width, first + width + 1};
      int sums[3] = {2, 2, 2};
      float nearest = kInfinity;
      bool nothing_in_range = false;
      for (long p : pixels) {
        for (int c = 0; c < 3; ++c) sums[c] += rgb[3 * p + c];
        if (measured(depth[p])) nearest = std::min(nearest, depth[p]);
        nothing_in_range |= depth[p] == kInfinity;
      }
      const long out = long(y) * half_width + x;
      for (int c = 0; c < 3; ++c) rgb_half[3 * out + c] = std::uint8_t(sums[c] / 4);
      if (nearest == kInfinity) {
        depth_half[out] = nothing_in_range ? kInfinity : 0.0f;
        continue;
      }
      float sum = 0.0f;
      int count = 0;
      for (long p : pixels) {
        if (measured(depth[p]) && depth[p] - nearest < edge_m) {
          sum += depth[p];
          ++count;
        }
      }
      depth_half[out] = sum / float(count);
    }
  }
}

void smooth_depth(const float* depth, int width, int height, int radius, float gate_m, float* smoothed) {
#pragma omp parallel for schedule(static)
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const long here = long(y) * width + x;
      const float z = depth[here];
      if (!measured(z)) {
        smoothed[here] = z;
        continue;
      }
      const float centre = 1.0f / z;
      const float gate = gate_m * centre * centre;
      float sum = centre;
      float weight = 1.0f;
      for (int dy = 0; dy <= radius; ++dy) {
        if (y - dy < 0 || y + dy >= height) break;
        for (int dx = (dy == 0 ? 1 : -radius); dx <= radius; ++dx) {
          if (x - std::abs(dx) < 0 || x + std::abs(dx) >= width) continue;
          const float a = depth[here + long(dy) * width + dx];
          const float b = depth[here - long(dy) * width - dx];
          if (!measured(a) || !measured(b)) continue;
          const float pair = 1.0f / a + 1.0f / b;
          if (std::abs(0.5f * pair - centre) < gate) {
            sum += pair;
            weight += 2.0f;
          }
        }
      }
      smoothed[here] = weight / sum;
    }
  }
}

}  // namespace hgs

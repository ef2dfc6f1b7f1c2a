#include "depth_filter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hgs {

namespace {
constexpr float kInfinity = std::numeric_limits<float>::infinity();
inline bool measured(float z) { return z > 0.0f && z < kInfinity; }

// The mean depth of the surface that most of four pixels show, the nearer one of two that show as many. With the
// nearest one, whoever has the most, everything would be half a pixel too wide.
float depth_of_most(const float depth[4], float edge_m) {
  float best = 0.0f;
  int most = 0, nothing_in_range = 0;
  for (int i = 0; i < 4; ++i) {
    nothing_in_range += depth[i] == kInfinity;
    if (!measured(depth[i])) continue;
    float sum = 0.0f;
    int count = 0;
    for (int j = 0; j < 4; ++j) {
      if (!measured(depth[j]) || std::abs(depth[j] - depth[i]) >= edge_m) continue;
      sum += depth[j];
      ++count;
    }
    const float mean = sum / float(count);
    if (count > most || (count == most && mean < best)) {
      most = count;
      best = mean;
    }
  }
  return nothing_in_range > most ? kInfinity : best;
}
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
      float depths[4];
      for (int i = 0; i < 4; ++i) {
        depths[i] = depth[pixels[i]];
        for (int c = 0; c < 3; ++c) sums[c] += rgb[3 * pixels[i] + c];
      }
      const long out = long(y) * half_width + x;
      for (int c = 0; c < 3; ++c) rgb_half[3 * out + c] = std::uint8_t(sums[c] / 4);
      depth_half[out] = depth_of_most(depths, edge_m);
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

#include "surface_normals.hpp"

#include <cmath>
#include <limits>

namespace hgs {
namespace {

constexpr int HALF_WINDOW = 3;
constexpr int EDGE = 2 * HALF_WINDOW + 1;
constexpr int FEWEST_ON_PLANE = 12;   // with fewer of the window's pixels on one plane, there is no normal
constexpr double OFF_PLANE_M = 0.03;  // pixels farther from the plane belong to something else
constexpr int FITS = 2;
constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();

// Inverse depth is a + b (u - u0) + c (v - v0).
struct Plane {
  double a, b, c;
};

// [1/m]; NaN beyond the image and where nothing was measured.
double inverse_depth(const DepthView& view, std::int64_t row, std::int64_t column) {
  if (row < 0 || row >= view.height || column < 0 || column >= view.width) return UNKNOWN;
  const float z = view.depth[row * view.width + column];
  return z > 0.0f && z < std::numeric_limits<float>::infinity() ? 1.0 / z : UNKNOWN;
}

// The smaller of the differences to both neighbours; 0 without any.
double slope_of(double before, double here, double after) {
  const double forward = after - here, backward = here - before;
  if (std::isnan(backward) || std::abs(forward) <= std::abs(backward)) return std::isnan(forward) ? 0.0 : forward;
  return backward;
}

// Sums over the pixels on a plane, of 1, u, v, their products, and the same times inverse depth.
struct Moments {
  int n = 0;
  double u = 0, v = 0, uu = 0, uv = 0, vv = 0, w = 0, uw = 0, vw = 0;

  void add(double du, double dv, double inverse) {
    ++n;
    u += du, v += dv, uu += du * du, uv += du * dv, vv += dv * dv;
    w += inverse, uw += du * inverse, vw += dv * inverse;
  }

  // Least squares, by Cramer's rule; hardly any damping keeps it defined on a line of pixels.
  Plane fit() const {
    constexpr double DAMPING = 1e-9;
    const double A = n + DAMPING, B = uu + DAMPING, C = vv + DAMPING;
    const double c00 = B * C - uv * uv, c01 = v * uv - u * C, c02 = u * uv - B * v;
    const double c11 = A * C - v * v, c12 = u * v - A * uv, c22 = A * B - u * u;
    const double share = 1.0 / (A * c00 + u * c01 + v * c02);
    return {share * (c00 * w + c01 * uw + c02 * vw), share * (c01 * w + c11 * uw + c12 * vw),
            share * (c02 * w + c12 * uw + c22 * vw)};
  }
};

void normal_at(const DepthView& view, std::int64_t row, std::int64_t column, double* out) {
  double around[EDGE][EDGE];
  for (int i = 0; i < EDGE; ++i) {
    for (int j = 0; j < EDGE; ++j) around[i][j] = inverse_depth(view, row + i - HALF_WINDOW, column + j - HALF_WINDOW);
  }
  constexpr int M = HALF_WINDOW;
  const double here = around[M][M], gate = OFF_PLANE_M * here * here;
  Plane plane{here, slope_of(around[M][M - 1], here, around[M][M + 1]),
              slope_of(around[M - 1][M], here, around[M + 1][M])};
  Moments on_plane;
  for (int fit = 0; fit < FITS; ++fit) {
    on_plane = Moments{};
    for (int i = 0; i < EDGE; ++i) {
      for (int j = 0; j < EDGE; ++j) {
        const double du = j - M, dv = i - M;
        // False for NaN.
        if (std::abs(around[i][j] - plane.a - plane.b * du - plane.c * dv) < gate) on_plane.add(du, dv, around[i][j]);
      }
    }
    plane = on_plane.fit();
  }
  // 1 / Z = a + b (u - u0) + c (v - v0) is n . p = 1 with u = fx X / Z + cx, v likewise.
  const double x = (static_cast<double>(column) + 0.5 - view.cx) / view.fx;
  const double y = (static_cast<double>(row) + 0.5 - view.cy) / view.fy;
  const double along_u = plane.b * view.fx, along_v = plane.c * view.fy;
  double towards[3] = {-along_u, -along_v, along_u * x + along_v * y - plane.a};
  if (on_plane.n < FEWEST_ON_PLANE || !(towards[0] * x + towards[1] * y + towards[2] < 0.0)) {
    towards[0] = -x, towards[1] = -y, towards[2] = -1.0;
  }
  const double share = 1.0 / std::sqrt(towards[0] * towards[0] + towards[1] * towards[1] + towards[2] * towards[2]);
  for (int k = 0; k < 3; ++k) out[k] = share * towards[k];
}

}  // namespace

void surface_normals(const DepthView& view, const std::int64_t* rows, const std::int64_t* columns, std::int64_t n,
                     double* normals) {
#pragma omp parallel for schedule(static)
  for (std::int64_t i = 0; i < n; ++i) normal_at(view, rows[i], columns[i], normals + 3 * i);
}

}  // namespace hgs

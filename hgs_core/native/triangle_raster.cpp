#include "triangle_raster.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "variants.hpp"

namespace hgs {
namespace {

constexpr int BAND = 16;  // rows
constexpr int MOST_LANES = 16;
constexpr std::int64_t AT_ONCE = 4096;     // triangles
constexpr double LEAST_DISTANCE_M = 1e-6;  // of the camera from a plane: nearer, the triangle is a line
constexpr double LEAST_Z_M = 1e-4;         // of corners that are projected
constexpr double MARGIN_PX = 1.5;          // looks aside, and rounding

struct Vector3 {
  double x, y, z;
};

Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
double dot(const Vector3& a, const Vector3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vector3 minus(const Vector3& a, const Vector3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }

// The picture's border as slopes of directions, a margin wider.
struct Frustum {
  double left, right, top, bottom;

  explicit Frustum(const LookingCamera& c)
      : left((-c.cx - MARGIN_PX) / c.fx),
        right((c.width - c.cx + MARGIN_PX) / c.fx),
        top((-c.cy - MARGIN_PX) / c.fy),
        bottom((c.height - c.cy + MARGIN_PX) / c.fy) {}

  // Whether all corners lie beyond one side. Also right for corners behind the camera.
  bool misses(const Vector3 corner[3]) const {
    int behind = 0, beyond[4] = {0, 0, 0, 0};
    for (int i = 0; i < 3; ++i) {
      const Vector3& p = corner[i];
      behind += p.z <= 0.0;
      beyond[0] += p.x < left * p.z;
      beyond[1] += p.x > right * p.z;
      beyond[2] += p.y < top * p.z;
      beyond[3] += p.y > bottom * p.z;
    }
    return behind == 3 || beyond[0] == 3 || beyond[1] == 3 || beyond[2] == 3 || beyond[3] == 3;
  }
};

std::vector<Vector3> in_camera(const MeshTriangles& mesh, const LookingCamera& camera) {
  std::vector<Vector3> corners(static_cast<std::size_t>(mesh.n_vertices));
  const double* r = camera.rotation;
#pragma omp parallel for schedule(static)
  for (std::int64_t i = 0; i < mesh.n_vertices; ++i) {
    const float* v = mesh.vertices + 3 * i;
    const double d[3] = {v[0] - camera.translation[0], v[1] - camera.translation[1], v[2] - camera.translation[2]};
    corners[static_cast<std::size_t>(i)] = {r[0] * d[0] + r[3] * d[1] + r[6] * d[2],
                                            r[1] * d[0] + r[4] * d[1] + r[7] * d[2],
                                            r[2] * d[0] + r[5] * d[1] + r[8] * d[2]};
  }
  return corners;
}

// Rows and columns that may show a triangle in front of the camera; all of them where it reaches behind.
void bound(const Vector3 corner[3], const LookingCamera& camera, DirectionTriangle& t) {
  t.first_row = t.first_column = 0;
  t.last_row = camera.height - 1;
  t.last_column = camera.width - 1;
  double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9};
  for (int i = 0; i < 3; ++i) {
    if (!(corner[i].z > LEAST_Z_M)) return;
    const double at[2] = {camera.fx * corner[i].x / corner[i].z + camera.cx,
                          camera.fy * corner[i].y / corner[i].z + camera.cy};
    for (int a = 0; a < 2; ++a) {
      low[a] = std::min(low[a], at[a]);
      high[a] = std::max(high[a], at[a]);
    }
  }
  const auto held = [](double pixel, int most) {
    return static_cast<std::int32_t>(std::clamp(pixel, -1.0, static_cast<double>(most)));
  };
  t.first_column = std::max(0, held(std::floor(low[0] - MARGIN_PX), camera.width));
  t.last_column = held(std::floor(high[0] + MARGIN_PX), camera.width - 1);
  t.first_row = std::max(0, held(std::floor(low[1] - MARGIN_PX), camera.height));
  t.last_row = held(std::floor(high[1] + MARGIN_PX), camera.height - 1);
}

// False for a triangle that no pixel shows.
bool prepare(const Vector3 corner[3], const LookingCamera& camera, DirectionTriangle& t) {
  const Vector3 normal = cross(minus(corner[1], corner[0]), minus(corner[2], corner[0]));
  const double volume = dot(normal, corner[0]), length = std::sqrt(dot(normal, normal));
  t.plane_distance = static_cast<float>(std::abs(volume) / length);
  if (!(std::abs(volume) > LEAST_DISTANCE_M * length)) return false;
  const double side = volume > 0.0 ? 1.0 : -1.0;
  for (int i = 0; i < 3; ++i) {
    const Vector3 edge = cross(corner[(i + 1) % 3], corner[(i + 2) % 3]);
    t.inside[i][0] = static_cast<float>(side * edge.x);
    t.inside[i][1] = static_cast<float>(side * edge.y);
    t.inside[i][2] = static_cast<float>(side * edge.z);
  }
  t.inverse_depth[0] = static_cast<float>(normal.x / volume);
  t.inverse_depth[1] = static_cast<float>(normal.y / volume);
  t.inverse_depth[2] = static_cast<float>(normal.z / volume);
  bound(corner, camera, t);
  return t.first_row <= t.last_row && t.first_column <= t.last_column;
}

// Those that the picture may show, in their order.
std::vector<DirectionTriangle> prepared(const MeshTriangles& mesh, const LookingCamera& camera) {
  const std::vector<Vector3> corners = in_camera(mesh, camera);
  const Frustum frustum(camera);
  const std::int64_t n_chunks = (mesh.n_triangles + AT_ONCE - 1) / AT_ONCE;
  std::vector<std::vector<DirectionTriangle>> chunks(static_cast<std::size_t>(n_chunks));
#pragma omp parallel for schedule(dynamic)
  for (std::int64_t chunk = 0; chunk < n_chunks; ++chunk) {
    std::vector<DirectionTriangle>& some = chunks[static_cast<std::size_t>(chunk)];
    const std::int64_t end = std::min((chunk + 1) * AT_ONCE, mesh.n_triangles);
    for (std::int64_t k = chunk * AT_ONCE; k < end; ++k) {
      const std::int32_t* v = mesh.triangles + 3 * k;
      const Vector3 corner[3] = {corners[static_cast<std::size_t>(v[0])], corners[static_cast<std::size_t>(v[1])],
                                 corners[static_cast<std::size_t>(v[2])]};
      DirectionTriangle t;
      if (frustum.misses(corner) || !prepare(corner, camera, t)) continue;
      t.number = static_cast<std::int32_t>(k);
      some.push_back(t);
    }
  }
  std::vector<DirectionTriangle> all;
  for (const auto& some : chunks) all.insert(all.end(), some.begin(), some.end());
  return all;
}

// Triangles by the bands of rows that they lie in: those of band b start at starts[b].
struct Bands {
  std::vector<std::int64_t> starts;
  std::vector<std::int32_t> chosen;

  Bands(const std::vector<DirectionTriangle>& triangles, int n_bands) : starts(static_cast<std::size_t>(n_bands) + 1) {
    for (const auto& t : triangles) {
      for (int b = t.first_row / BAND; b <= t.last_row / BAND; ++b) ++starts[static_cast<std::size_t>(b) + 1];
    }
    for (std::size_t b = 1; b < starts.size(); ++b) starts[b] += starts[b - 1];
    chosen.resize(static_cast<std::size_t>(starts.back()));
    std::vector<std::int64_t> next(starts.begin(), starts.end() - 1);
    for (std::size_t k = 0; k < triangles.size(); ++k) {
      for (int b = triangles[k].first_row / BAND; b <= triangles[k].last_row / BAND; ++b) {
        chosen[static_cast<std::size_t>(next[static_cast<std::size_t>(b)]++)] = static_cast<std::int32_t>(k);
      }
    }
  }
};

int stride_of(const LookingCamera& camera) { return (camera.width + MOST_LANES - 1) / MOST_LANES * MOST_LANES; }

// x and y of the directions that one look a pixel takes.
struct Directions {
  std::vector<float> columns, rows;

  Directions(const LookingCamera& c, const float offset[2])
      : columns(static_cast<std::size_t>(stride_of(c))), rows(static_cast<std::size_t>(c.height)) {
    for (std::size_t k = 0; k < columns.size(); ++k) {
      columns[k] = static_cast<float>((static_cast<double>(k) + 0.5 + offset[0] - c.cx) / c.fx);
    }
    for (std::size_t k = 0; k < rows.size(); ++k) {
      rows[k] = static_cast<float>((static_cast<double>(k) + 0.5 + offset[1] - c.cy) / c.fy);
    }
  }
};

void describe(const DirectionTriangle* t, float x, float y, float inverse_depth, std::int64_t at,
              const FirstSurfaces& found) {
  if (t == nullptr) {
    found.triangle[at] = 0xFFFFFFFFu;
    found.barycentric[2 * at] = found.barycentric[2 * at + 1] = found.facing[at] = 0.0f;
    found.z_depth[at] = std::numeric_limits<float>::infinity();
    return;
  }
  float weight[3], sum = 0.0f;
  for (int i = 0; i < 3; ++i) {
    weight[i] = t->inside[i][0] * x + t->inside[i][1] * y + t->inside[i][2];
    sum += weight[i];
  }
  const float share = sum > 0.0f ? 1.0f / sum : 0.0f;
  found.triangle[at] = static_cast<std::uint32_t>(t->number);
  found.barycentric[2 * at] = std::clamp(weight[1] * share, 0.0f, 1.0f);
  found.barycentric[2 * at + 1] = std::clamp(weight[2] * share, 0.0f, 1.0f);
  found.z_depth[at] = 1.0f / inverse_depth;
  found.facing[at] = t->plane_distance * inverse_depth;
}

// The mask by stride, and where each row's pixels start among the wanted ones.
struct WantedPixels {
  std::vector<std::uint8_t> mask;  // empty: all
  std::vector<std::int64_t> row_starts;

  WantedPixels(const std::uint8_t* wanted, const LookingCamera& camera)
      : row_starts(static_cast<std::size_t>(camera.height) + 1) {
    const auto stride = static_cast<std::size_t>(stride_of(camera)), width = static_cast<std::size_t>(camera.width);
    if (wanted != nullptr) mask.resize(stride * static_cast<std::size_t>(camera.height));
    for (std::size_t row = 0; row + 1 < row_starts.size(); ++row) {
      std::int64_t n = camera.width;
      if (wanted != nullptr) {
        const std::uint8_t* from = wanted + row * width;
        std::copy(from, from + width, mask.begin() + static_cast<std::ptrdiff_t>(row * stride));
        n -= std::count(from, from + width, std::uint8_t{0});
      }
      row_starts[row + 1] = row_starts[row] + n;
    }
  }
};

}  // namespace

void first_surfaces(const MeshTriangles& mesh, const LookingCamera& camera, const Looks& looks,
                    const FirstSurfaces& found) {
  const std::vector<DirectionTriangle> triangles = prepared(mesh, camera);
  const int n_bands = (camera.height + BAND - 1) / BAND, stride = stride_of(camera);
  const Bands bands(triangles, n_bands);
  const WantedPixels wanted(looks.wanted, camera);
  const std::uint8_t* mask = looks.wanted == nullptr ? nullptr : wanted.mask.data();
  std::vector<Directions> directions;
  for (int look = 0; look < looks.n_looks; ++look) directions.emplace_back(camera, looks.offsets + 2 * look);
  const FillRows fill = variant_kernels().fill_rows;
#pragma omp parallel
  {
    std::vector<float> inverse_depth(static_cast<std::size_t>(stride) * BAND);
    std::vector<std::int32_t> nearest(static_cast<std::size_t>(stride) * BAND);
#pragma omp for schedule(dynamic) collapse(2)
    for (int band = 0; band < n_bands; ++band) {
      for (int look = 0; look < looks.n_looks; ++look) {
        const Directions& towards = directions[static_cast<std::size_t>(look)];
        const std::int64_t* starts = bands.starts.data() + band;
        const RasterRows rows{stride,
                              band * BAND,
                              std::min((band + 1) * BAND, camera.height),
                              towards.columns.data(),
                              towards.rows.data(),
                              mask,
                              triangles.data(),
                              bands.chosen.data() + starts[0],
                              starts[1] - starts[0]};
        fill(rows, inverse_depth.data(), nearest.data());
        for (int row = rows.first; row < rows.last; ++row) {
          const std::size_t start = static_cast<std::size_t>(row - rows.first) * static_cast<std::size_t>(stride);
          std::int64_t at = look * looks.n_wanted + wanted.row_starts[static_cast<std::size_t>(row)];
          for (int column = 0; column < camera.width; ++column) {
            if (mask != nullptr && mask[std::ptrdiff_t{1} * row * stride + column] == 0) continue;
            const std::size_t pixel = start + static_cast<std::size_t>(column);
            const DirectionTriangle* t = nearest[pixel] < 0 ? nullptr : triangles.data() + nearest[pixel];
            describe(t, rows.columns[column], rows.rows[row], inverse_depth[pixel], at++, found);
          }
        }
      }
    }
  }
}

}  // namespace hgs

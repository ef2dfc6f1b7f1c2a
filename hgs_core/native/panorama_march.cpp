// 360-degree panoramas marched through voxels: unseen volume per direction (HGS-Planner Eq. 4).
//
// A panorama is a cylinder: columns are azimuths phi, rows are u = tan(elevation), so that a level pinhole camera
// sees straight rows. With rho the horizontal distance, volume is dV = rho^2 drho du dphi. A ray of bin
// (du, dphi), split by exact traversal into pieces [rho_0, rho_1] of one voxel each, with T the share of
// light that the voxels before let through (exp of minus optical depth times length), adds
//   unseen volume   T (rho_1^3 - rho_0^3) / 3 du dphi           for a voxel whose sight is a gain
//   unseen voxels   T                                           the same, per pixel (the paper's measure)
//   new surface     T kappa (rho_1^3 - rho_0^3) / 3 du dphi     the same, if it holds kappa of surface per volume;
//                                                               such a voxel lets exp(-kappa l) of the light through
//
// Rows are staggered within their bins by the golden ratio: directions spread evenly, and no voxel is missed by
// all rows at once.
#include <cmath>
#include <numbers>
#include <vector>

#include "gain_kernels.hpp"
#include "variants.hpp"

namespace hgs {

namespace {

// The rays of a panorama, column by column.
struct Directions {
  std::vector<float> dx, dy, dz, length;

  explicit Directions(const Panorama& panorama) {
    const double d_phi = 2.0 * std::numbers::pi / panorama.n_azimuth;
    const double d_u = (panorama.tan_high - panorama.tan_low) / panorama.n_elevation;
    for (std::int64_t azimuth = 0; azimuth < panorama.n_azimuth; ++azimuth) {
      for (std::int64_t row = 0; row < panorama.n_elevation; ++row) {
        const double phi = (azimuth + row_stagger(row)) * d_phi - std::numbers::pi;
        const double u = panorama.tan_low + (row + 0.5) * d_u;
        dx.push_back(static_cast<float>(panorama.range * std::cos(phi)));
        dy.push_back(static_cast<float>(panorama.range * std::sin(phi)));
        dz.push_back(static_cast<float>(panorama.range * u));
        length.push_back(static_cast<float>(panorama.range * std::sqrt(1.0 + u * u)));
      }
    }
  }
};

}  // namespace

void march_panoramas(const Grid& grid, const PanoramaCell* cells, const double* positions, std::int64_t n_positions,
                     const Panorama& panorama, float* unseen_volume, float* unseen_voxels,
                     float* new_surface, std::int32_t* first_unseen, std::uint8_t* entered) {
  const double d_phi = 2.0 * std::numbers::pi / panorama.n_azimuth;
  const double d_u = (panorama.tan_high - panorama.tan_low) / panorama.n_elevation;
  const auto volume_scale = static_cast<float>(std::pow(panorama.range, 3.0) / 3.0 * d_u * d_phi);
  const auto area_scale = static_cast<float>(panorama.range * panorama.range * d_u * d_phi);
  const PanoramaCells voxels{cells,
                             {static_cast<std::int32_t>(grid.shape[0]), static_cast<std::int32_t>(grid.shape[1]),
                              static_cast<std::int32_t>(grid.shape[2])},
                             static_cast<std::int32_t>((grid.shape[1] + CHUNK - 1) / CHUNK)};
  const std::int64_t n_chunks = (grid.shape[0] + CHUNK - 1) / CHUNK * voxels.chunks_y;
  const Directions directions(panorama);
  const std::int64_t n_rows = panorama.n_elevation;
#pragma omp parallel
  {
    std::vector<std::uint8_t> own_entered(static_cast<std::size_t>(n_chunks));
    std::vector<float> column(static_cast<std::size_t>(3 * n_rows));
    std::vector<std::int32_t> first_cells(static_cast<std::size_t>(n_rows));
    const PanoramaSums sums{column.data(), column.data() + n_rows, column.data() + 2 * n_rows, first_cells.data(),
                            own_entered.data()};
#pragma omp for collapse(2) schedule(dynamic, 8)
    for (std::int64_t n = 0; n < n_positions; ++n) {
      for (std::int64_t azimuth = 0; azimuth < panorama.n_azimuth; ++azimuth) {
        const double* from = positions + 3 * n;
        const std::int64_t ray = azimuth * n_rows;
        const PanoramaRays rays{
            {static_cast<float>(from[0]), static_cast<float>(from[1]), static_cast<float>(from[2])},
            directions.dx.data() + ray, directions.dy.data() + ray, directions.dz.data() + ray,
            directions.length.data() + ray, static_cast<int>(n_rows)};
        variant_kernels().gain.march(voxels, rays, panorama, sums);
        for (std::int64_t row = 0; row < n_rows; ++row) {
          const std::int64_t bin = (n * n_rows + row) * panorama.n_azimuth + azimuth;
          unseen_volume[bin] = sums.volume[row] * volume_scale;
          unseen_voxels[bin] = sums.voxels[row];
          new_surface[bin] = sums.surface[row] * area_scale;
          first_unseen[bin] = sums.first_unseen[row];
        }
      }
    }
#pragma omp critical(entered_chunks)
    for (std::int64_t chunk = 0; chunk < n_chunks; ++chunk) entered[chunk] |= own_entered[chunk];
  }
}

void slide_window(const float* panoramas, std::int64_t n, std::int64_t n_rows, std::int64_t n_azimuth,
                  const double* window, double* sums) {
#pragma omp parallel for schedule(static)
  for (std::int64_t i = 0; i < n; ++i) {
    double* own = sums + i * n_azimuth;
    std::vector<double> around(static_cast<std::size_t>(2 * n_azimuth));
    for (std::int64_t k = 0; k < n_azimuth; ++k) own[k] = 0.0;
    for (std::int64_t row = 0; row < n_rows; ++row) {
      const float* values = panoramas + (i * n_rows + row) * n_azimuth;
      for (std::int64_t k = 0; k < n_azimuth; ++k) around[k] = around[k + n_azimuth] = values[k];
      for (std::int64_t m = 0; m < n_azimuth; ++m) {
        const double weight = window[row * n_azimuth + m];
        if (weight == 0.0) continue;
        const double* shifted = around.data() + m;
        for (std::int64_t k = 0; k < n_azimuth; ++k) own[k] += weight * shifted[k];
      }
    }
  }
}

}  // namespace hgs

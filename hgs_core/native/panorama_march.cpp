// 360-degree panoramas marched through voxels: unseen volume and quality per direction (HGS-Planner Eq. 4, 5-9).
//
// A panorama is a cylinder: columns are azimuths phi, rows are u = tan(elevation), so that a level pinhole camera
// sees straight rows. With rho the horizontal distance, volume is dV = rho^2 drho du dphi. A ray of bin
// (du, dphi), split by exact traversal into pieces [rho_0, rho_1] of one voxel each, with T the share of
// light that the voxels before let through (exp of minus optical depth times length), adds
//   unseen volume   T (rho_1^3 - rho_0^3) / 3 du dphi           for a voxel whose sight is a gain
//   unseen voxels   T                                           the same, per pixel (the paper's measure)
//   quality         T' q (rho_1 - rho_0) du dphi                q = Q_v / V: the integral of q T' dV / rho^2,
//                                                               that is sum_v T' Q_v / rho^2 over voxels;
//                                               Q_v / rho_s^2 nearer than the saturation distance rho_s
//
// T' is T as it was before the face that the ray is in. A face is a run of voxels that stop most of the light, with
// gaps of at most `face_gap`; it does not hide itself. Without this a surface seen at a grazing angle, whose ray
// crosses many voxels of its layer, would hide most of its own Gaussians, and so would one that lies at a voxel
// border and fills both sides. The ray ends where it leaves the face with nothing left of it.
//
// Rows are staggered within their bins by the golden ratio: directions spread evenly, and no voxel is missed by
// all rows at once.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "gain_kernels.hpp"

namespace hgs {

namespace {

// Integral of min(1, (t / saturation)^2) over [t_0, t_1].
double quality_length(double t_0, double t_1, double saturation) {
  if (t_0 >= saturation) return t_1 - t_0;
  const double t = std::min(t_1, saturation);
  return (t * t * t - t_0 * t_0 * t_0) / (3.0 * saturation * saturation) + (t_1 - t);
}

}  // namespace

void march_panoramas(const Grid& grid, const PanoramaCell* cells, const double* positions, std::int64_t n_positions,
                     const Panorama& panorama, float* unseen_volume, float* unseen_voxels, float* quality) {
  constexpr float kSurface = 0.6931f;  // stops half of the light over one edge length
  constexpr double kGolden = 0.6180339887498949;
  const double d_phi = 2.0 * std::numbers::pi / panorama.n_azimuth;
  const double d_u = (panorama.tan_high - panorama.tan_low) / panorama.n_elevation;
  const double volume_scale = std::pow(panorama.range, 3.0) / 3.0 * d_u * d_phi;
  const double quality_scale = panorama.range * d_u * d_phi;
  const double saturation = panorama.saturation / panorama.range;
  const double face_gap = panorama.face_gap / panorama.range;

#pragma omp parallel for collapse(2) schedule(dynamic, 4)
  for (std::int64_t n = 0; n < n_positions; ++n) {
    for (std::int64_t azimuth = 0; azimuth < panorama.n_azimuth; ++azimuth) {
      const Point from{positions[3 * n], positions[3 * n + 1], positions[3 * n + 2]};
      for (std::int64_t row = 0; row < panorama.n_elevation; ++row) {
        const double stagger = kGolden * (row + 1);
        const double phi = (azimuth + stagger - std::floor(stagger)) * d_phi - std::numbers::pi;
        const double u = panorama.tan_low + (row + 0.5) * d_u;
        const Point to{from[0] + panorama.range * std::cos(phi), from[1] + panorama.range * std::sin(phi),
                       from[2] + panorama.range * u};
        const double length = panorama.range * std::sqrt(1.0 + u * u);
        double t_first, t_last, volume = 0.0, voxels = 0.0, gained = 0.0;
        if (clip_to_grid(grid, from, to, t_first, t_last)) {
          double now = 1.0, before_face = 1.0, face_left = -1.0;
          walk(grid, from, to, t_first, t_last, [&](const Cell& c, double t_0, double t_1) {
            const PanoramaCell& cell = cells[grid.offset(c)];
            const bool in_face = face_left >= 0.0 && t_0 - face_left <= face_gap;
            if (!in_face) before_face = now;
            if (before_face < panorama.opaque_below) return false;
            if (now >= panorama.opaque_below && cell.unseen > 0.0f) {
              volume += now * (t_1 * t_1 * t_1 - t_0 * t_0 * t_0);
              voxels += now;
            }
            gained += before_face * cell.quality * quality_length(t_0, t_1, saturation);
            if (cell.optical_depth > 0.0f) {
              const bool opaque = std::isinf(cell.optical_depth);
              now = opaque ? 0.0 : now * std::exp(-cell.optical_depth * (t_1 - t_0) * length);
              if (cell.optical_depth >= kSurface) face_left = t_1;
            }
            return true;
          });
        }
        const std::int64_t bin = (n * panorama.n_elevation + row) * panorama.n_azimuth + azimuth;
        unseen_volume[bin] = static_cast<float>(volume * volume_scale);
        unseen_voxels[bin] = static_cast<float>(voxels);
        quality[bin] = static_cast<float>(gained * quality_scale);
      }
    }
  }
  }

}  // namespace hgs

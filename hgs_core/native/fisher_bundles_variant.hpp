// Gaussians sorted into cells and bundled, sixteen at a time.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "fisher_rays.hpp"
#include "parameter_column_variant.hpp"
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

inline constexpr float FAINTEST_LOGIT = -5.53733f;  // of an opacity of 1/255: nothing is drawn of it

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

// Discs reach farther off the axis of a camera, as flat images stretch things there: so much at 37 degrees up or down.
// To the side a ray is on the axis of its camera, and so is all that it meets but what is as large as it is near.
inline constexpr float DISC_STRETCH = 1.25f;

static void make_bundle(const float* parameters, const float* normals, const std::uint32_t* rows, std::int32_t n,
                        const FisherRule& rule, Bundle& bundle, BundleNormals* bundle_normals, BundleBounds& bounds) {
  const float stretch = normals == nullptr ? 1.0f : DISC_STRETCH;
  alignas(64) float log_radius[BUNDLE], logit[BUNDLE], reach[BUNDLE];
  for (int i = 0; i < BUNDLE; ++i) {
    const std::uint32_t row = rows[i < n ? i : n - 1];  // places that are left over change no bounds
    const float* p = parameters + N_PARAMETERS * static_cast<std::size_t>(row);
    bundle.x[i] = p[0];
    bundle.y[i] = p[1];
    bundle.z[i] = p[2];
    log_radius[i] = p[6];
    logit[i] = p[7];
    bundle.row[i] = row;
    if (normals == nullptr) continue;
    const float* normal = normals + N_NORMAL * static_cast<std::size_t>(row);
    bundle_normals->x[i] = normal[0];
    bundle_normals->y[i] = normal[1];
    bundle_normals->z[i] = normal[2];
  }
  const float widest_low_pass = rule.low_pass * rule.range * rule.range;
  const float* centres[3] = {bundle.x, bundle.y, bundle.z};
  VFloat low[3], high[3];
  for (int a = 0; a < 3; ++a) {
    low[a] = splat_all(__builtin_inff());
    high[a] = -low[a];
  }
  for (int i = 0; i < BUNDLE; i += LANES) {
    const VFloat radius = vexp(load(log_radius + i)), radius2 = radius * radius;
    const VFloat opacity = 1.0f / (1.0f + vexp(-load(logit + i)));
    const VFloat decay = 2.0f * vlog(vmax(opacity * 255.0f, splat_all(1.0f)));
    const VFloat reaches = stretch * vsqrt(decay * (radius2 + widest_low_pass));
    store(bundle.radius2 + i, radius2);
    store(bundle.decay + i, decay);
    store(reach + i, reaches);
    for (int a = 0; a < 3; ++a) {
      low[a] = vmin(low[a], load(centres[a] + i) - reaches);
      high[a] = vmax(high[a], load(centres[a] + i) + reaches);
    }
  }
  for (int a = 0; a < 3; ++a) {
    bounds.low[a] = lowest(low[a]);
    bounds.high[a] = -lowest(-high[a]);
    bounds.centre[a] = 0.5f * (bounds.low[a] + bounds.high[a]);
  }
  VFloat farthest{};
  for (int i = 0; i < BUNDLE; i += LANES) {
    VFloat d2{};
    for (int a = 0; a < 3; ++a) {
      const VFloat d = load(centres[a] + i) - bounds.centre[a];
      d2 += d * d;
    }
    farthest = vmax(farthest, vsqrt(d2) + load(reach + i));
  }
  bounds.radius = -lowest(-farthest);
  for (int i = n; i < BUNDLE; ++i) bundle.decay[i] = -1.0f;
}

}  // namespace hgs::HGS_VARIANT

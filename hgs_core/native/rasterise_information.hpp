// The sweeps behind Fisher information: the second sweep of a tile when it is the map that is judged, not the image.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "rasterise_loss.hpp"

namespace hgs::HGS_VARIANT {

// What a pair's eight sums mean after a Fisher sweep; E = sum over channels of (alpha dC/dalpha)^2.
enum { SUM_E, SUM_E_XX, SUM_E_XY, SUM_E_YY, SUM_E_XD, SUM_E_YD, SUM_E_DD, SUM_W2 };  // D: d^2

// T, what is still to come of each channel, and the rendered gain.
enum { FT_PLANE, SR_PLANE, SG_PLANE, SB_PLANE, GAIN_PLANE, FISHER_PLANES };
using FisherTile = TilePlanes<FISHER_PLANES>;

// Everything is still to come.
static void start_fisher(const ForwardTile& state, const Window& window, FisherTile& fisher) {
  __builtin_memset(&fisher, 0, sizeof(fisher));
  for (int y = 0; y < window.height; ++y) {
    for (int x = 0; x < window.width; ++x) {
      const PixelPlace at = place_of(x, y);
      float(*planes)[PATCH] = fisher.patches[at.patch];
      planes[FT_PLANE][at.lane] = 1.0f;
      for (int k = 0; k < 3; ++k) planes[SR_PLANE + k][at.lane] = state.patches[at.patch][R_PLANE + k][at.lane];
    }
  }
}

// E in one vector of pixels; advances T and the sums to come.
HGS_INLINE VFloat fisher_pixels(float* pixels, VFloat a, const Trace& trace, VFloat& weight) {
  const VFloat T = load(pixels + FT_PLANE * PATCH);
  const VFloat alpha = masked_alpha(a, T);
  weight = alpha * T;
  const VFloat ratio = alpha * inverse(1.0f - alpha);
  const VFloat red = trace.spot.r * weight, green = trace.spot.g * weight, blue = trace.spot.b * weight;
  const VFloat sr = load(pixels + SR_PLANE * PATCH) - red;
  const VFloat sg = load(pixels + SG_PLANE * PATCH) - green;
  const VFloat sb = load(pixels + SB_PLANE * PATCH) - blue;
  store(pixels + FT_PLANE * PATCH, T - weight);
  store(pixels + SR_PLANE * PATCH, sr);
  store(pixels + SG_PLANE * PATCH, sg);
  store(pixels + SB_PLANE * PATCH, sb);
  const VFloat pr = red - sr * ratio, pg = green - sg * ratio, pb = blue - sb * ratio;
  return where(at_least(splat_all(MAX_ALPHA), a), pr * pr + pg * pg + pb * pb);
}

// Calls visit(pixels, a, x, y) for every vector of pixels that the trace touches, (x, y) from the splat.
template <class Visit>
HGS_INLINE void for_each_vector(const TileFrame& frame, const Trace& trace, FisherTile& state, Visit&& visit) {
  const VFloat lx = lane_x(), ly = lane_y();
  VectorOrigins origins;
  origins_from(trace.spot, frame, origins);
  for (std::uint32_t bits = trace.patches; bits != 0; bits &= bits - 1) {
    const std::uint32_t patch = static_cast<std::uint32_t>(__builtin_ctz(bits));
    for (int part = 0; part < PARTS; ++part) {
      visit(state.patches[patch][0] + part * LANES, footprint(trace, patch, part), origins.x[patch] + lx,
            origins.y[part][patch] + ly);
    }
  }
}

static void sweep_fisher(const Tile& tile, Traces traces, FisherTile& state, float* pair_sums) {
  TileFrame frame;
  frame_tile(tile, frame);
  for (std::uint32_t i = 0; i < traces.n; ++i) {
    const Trace& trace = traces.first[i];
    VFloat sums[8] = {};
    for_each_vector(frame, trace, state, [&](float* pixels, VFloat a, VFloat x, VFloat y) HGS_LAMBDA {
      VFloat weight;
      const VFloat E = fisher_pixels(pixels, a, trace, weight);
      const VFloat Ex = E * x, Ey = E * y, d2 = x * x + y * y;
      sums[SUM_E] += E;
      sums[SUM_E_XX] += Ex * x;
      sums[SUM_E_XY] += Ex * y;
      sums[SUM_E_YY] += Ey * y;
      sums[SUM_E_XD] += Ex * d2;
      sums[SUM_E_YD] += Ey * d2;
      sums[SUM_E_DD] += E * d2 * d2;
      sums[SUM_W2] += weight * weight;
    });
    sum_lanes_of_8(sums, pair_sums + 8 * std::size_t{trace.entry.pair});
  }
}

// Adds to the gain plane, per splat, E c_0 + E (c_1 .. c_6) . (xx, xy, yy, xd, yd, dd) + c_7 w^2.
static void sweep_quality(const Tile& tile, Traces traces, FisherTile& state,
                          const float* slot_coefficients) {
  TileFrame frame;
  frame_tile(tile, frame);
  for (std::uint32_t i = 0; i < traces.n; ++i) {
    const Trace& trace = traces.first[i];
    const float* c = slot_coefficients + 8 * std::size_t{trace.entry.slot};
    for_each_vector(frame, trace, state, [&](float* pixels, VFloat a, VFloat x, VFloat y) HGS_LAMBDA {
      VFloat weight;
      const VFloat E = fisher_pixels(pixels, a, trace, weight);
      const VFloat d2 = x * x + y * y;
      const VFloat form = c[SUM_E] + c[SUM_E_XX] * x * x + c[SUM_E_XY] * x * y + c[SUM_E_YY] * y * y +
                          d2 * (c[SUM_E_XD] * x + c[SUM_E_YD] * y + c[SUM_E_DD] * d2);
      const VFloat gain = load(pixels + GAIN_PLANE * PATCH) + E * form + c[SUM_W2] * weight * weight;
      store(pixels + GAIN_PLANE * PATCH, gain);
    });
  }
}

}  // namespace hgs::HGS_VARIANT

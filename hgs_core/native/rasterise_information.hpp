// The sweeps behind Fisher information: the second sweep of a tile when it is the map that is judged, not the image.
// Included only by the variant files (see simd.hpp).
#pragma once
#include <type_traits>

#include "rasterise_loss.hpp"

namespace hgs::HGS_VARIANT {

// What a pair's sums mean after a Fisher sweep; E = sum over channels of (alpha dC/dalpha)^2. X, Y: of d, and D: d^2.
namespace round_fisher {
enum { E, E_XX, E_XY, E_YY, E_XD, E_YD, E_DD, W2 };
}
// X, Y: of q = Q d. The first 12 are the products of two of (X, Y, XX, XY, YY).
namespace disc_fisher {
enum { E_XX, E_XY, E_YY, E_XXX, E_XXY, E_XYY, E_YYY, E_XXXX, E_XXXY, E_XXYY, E_XYYY, E_YYYY, MOMENTS, E = MOMENTS, W2 };
}

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
template <class Trace>
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
template <class Trace, class Visit>
HGS_INLINE void for_each_vector(const TileFrame& frame, const Trace& trace, FisherTile& state, Visit&& visit) {
  const VFloat lx = lane_x(), ly = lane_y();
  VectorOrigins origins;
  origins.see_from(trace.spot, frame);
  for (std::uint32_t bits = trace.patches; bits != 0; bits &= bits - 1) {
    const std::uint32_t patch = static_cast<std::uint32_t>(__builtin_ctz(bits));
    for (int part = 0; part < PARTS; ++part) {
      visit(state.patches[patch][0] + part * LANES, footprint(trace, frame, patch, part).a, origins.x[patch] + lx,
            origins.y[part][patch] + ly);
    }
  }
}

template <class Shape>
struct FisherSums;

template <>
struct FisherSums<Isotropic> {
  VFloat sums[8] = {};

  HGS_INLINE void add(const RoundSpot&, VFloat E, VFloat weight, VFloat x, VFloat y) {
    namespace s = round_fisher;
    const VFloat Ex = E * x, Ey = E * y, d2 = x * x + y * y;
    sums[s::E] += E;
    sums[s::E_XX] += Ex * x;
    sums[s::E_XY] += Ex * y;
    sums[s::E_YY] += Ey * y;
    sums[s::E_XD] += Ex * d2;
    sums[s::E_YD] += Ey * d2;
    sums[s::E_DD] += E * d2 * d2;
    sums[s::W2] += weight * weight;
  }
  HGS_INLINE void write(float* out) const { sum_lanes_of_8(sums, out); }
};

// q = Q d.
struct Scaled {
  VFloat x, y;
};

HGS_INLINE Scaled scaled(const DiscSpot& spot, VFloat x, VFloat y) {
  const VFloat qx = (x - spot.lean * y) * (spot.across * (1.0f / HALF_LOG2_E));
  return {qx, y * (spot.down * (1.0f / HALF_LOG2_E)) - spot.lean * qx};
}

template <>
struct FisherSums<Disc> {
  VFloat sums[16] = {};

  HGS_INLINE void add(const DiscSpot& spot, VFloat E, VFloat weight, VFloat x, VFloat y) {
    namespace s = disc_fisher;
    const Scaled q = scaled(spot, x, y);
    const VFloat xx = q.x * q.x, xy = q.x * q.y, yy = q.y * q.y, Exx = E * xx, Exy = E * xy, Eyy = E * yy;
    sums[s::E] += E;
    sums[s::E_XX] += Exx;
    sums[s::E_XY] += Exy;
    sums[s::E_YY] += Eyy;
    sums[s::E_XXX] += Exx * q.x;
    sums[s::E_XXY] += Exx * q.y;
    sums[s::E_XYY] += Eyy * q.x;
    sums[s::E_YYY] += Eyy * q.y;
    sums[s::E_XXXX] += Exx * xx;
    sums[s::E_XXXY] += Exx * xy;
    sums[s::E_XXYY] += Exx * yy;
    sums[s::E_XYYY] += Exy * yy;
    sums[s::E_YYYY] += Eyy * yy;
    sums[s::W2] += weight * weight;
  }
  HGS_INLINE void write(float* out) const {
    sum_lanes_of_8(sums, out);
    sum_lanes_of_8(sums + 8, out + 8);
  }
};

template <class Shape>
static void sweep_fisher(const Tile& tile, Traces<Shape> traces, FisherTile& state, float* pair_sums) {
  TileFrame frame;
  frame_tile(tile, frame);
  for (std::uint32_t i = 0; i < traces.n; ++i) {
    const typename Shape::Trace& trace = traces.first[i];
    FisherSums<Shape> sums;
    for_each_vector(frame, trace, state, [&](float* pixels, VFloat a, VFloat x, VFloat y) HGS_LAMBDA {
      VFloat weight;
      const VFloat E = fisher_pixels(pixels, a, trace, weight);
      sums.add(trace.spot, E, weight, x, y);
    });
    sums.write(pair_sums + Shape::SUMS * std::size_t{trace.entry.pair});
  }
}

// What multiplies E in the gain of a pixel at (x, y) from the splat, see Slopes::form.
HGS_INLINE VFloat value_of_form(const RoundSpot&, const float* c, VFloat x, VFloat y) {
  namespace s = round_fisher;
  const VFloat d2 = x * x + y * y;
  return c[s::E] + c[s::E_XX] * x * x + c[s::E_XY] * x * y + c[s::E_YY] * y * y +
         d2 * (c[s::E_XD] * x + c[s::E_YD] * y + c[s::E_DD] * d2);
}

HGS_INLINE VFloat value_of_form(const DiscSpot& spot, const float* c, VFloat dx, VFloat dy) {
  namespace s = disc_fisher;
  const Scaled q = scaled(spot, dx, dy);
  const VFloat x = q.x, y = q.y, xx = x * x, yy = y * y;
  return c[s::E] + xx * (c[s::E_XX] + c[s::E_XXX] * x + c[s::E_XXY] * y + c[s::E_XXXX] * xx) +
         x * y * (c[s::E_XY] + c[s::E_XXXY] * xx + c[s::E_XYYY] * yy) +
         yy * (c[s::E_YY] + c[s::E_XYY] * x + c[s::E_YYY] * y + c[s::E_XXYY] * xx + c[s::E_YYYY] * yy);
}

// Adds to the gain plane, per splat, E times its form at the pixel, and the colours' share of w^2.
template <class Shape>
static void sweep_quality(const Tile& tile, Traces<Shape> traces, FisherTile& state, const float* slot_coefficients) {
  constexpr int W2 = std::is_same_v<Shape, Disc> ? int{disc_fisher::W2} : int{round_fisher::W2};
  TileFrame frame;
  frame_tile(tile, frame);
  for (std::uint32_t i = 0; i < traces.n; ++i) {
    const typename Shape::Trace& trace = traces.first[i];
    const float* c = slot_coefficients + Shape::SUMS * std::size_t{trace.entry.slot};
    for_each_vector(frame, trace, state, [&](float* pixels, VFloat a, VFloat x, VFloat y) HGS_LAMBDA {
      VFloat weight;
      const VFloat E = fisher_pixels(pixels, a, trace, weight);
      const VFloat form = value_of_form(trace.spot, c, x, y);
      const VFloat gain = load(pixels + GAIN_PLANE * PATCH) + E * form + c[W2] * weight * weight;
      store(pixels + GAIN_PLANE * PATCH, gain);
    });
  }
}

}  // namespace hgs::HGS_VARIANT

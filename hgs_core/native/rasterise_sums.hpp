// What the second sweep adds up of a splat in a tile, for the chain rule to its parameters.
// Included only by the variant files (see simd.hpp).
//
// Of a round splat, a sum over pixels of P dx is one over vectors: with X the place of a vector's first pixel and lx a
// lane's place from there, sum P dx = sum (P X) + lx sum P, and so on. What is added in the loop is P times numbers of
// the vector, whose pixels need no places of their own.
#pragma once
#include "rasterise_patches.hpp"

namespace hgs::HGS_VARIANT {

// What a pair's sums mean after a backward sweep; P = alpha dL/dalpha, Z = w dL/dD.
namespace round_sums {
enum { P, P_DX, P_DY, P_D2, R, G, B, Z };
}
namespace disc_sums {
enum { P, P_H, P_DY, P_HH, P_HY, P_YY, R, G, B, Z, Z_H, Z_DY };  // H: h, see DiscSpot
}

// Where the first pixels of a tile's vectors lie as seen from a splat.
struct VectorOrigins {
  alignas(64) float x[PATCHES], y[PARTS][PATCHES];

  template <class Spot>
  HGS_INLINE void see_from(const Spot& spot, const TileFrame& frame) {
    for (int first = 0; first < PATCHES; first += LANES) {
      store(x + first, load(frame.left + first) - spot.u);
      for (int part = 0; part < PARTS; ++part) {
        store(y[part] + first, load(frame.top + first) - (spot.v - static_cast<float>(part * PART_ROWS)));
      }
    }
  }
};

template <class Shape>
struct BackwardOrigins;

// With the squares of their distances.
template <>
struct BackwardOrigins<Isotropic> : VectorOrigins {
  alignas(64) float d2[PARTS][PATCHES];

  HGS_INLINE void see_from(const RoundSpot& spot, const TileFrame& frame) {
    VectorOrigins::see_from(spot, frame);
    for (int first = 0; first < PATCHES; first += LANES) {
      const VFloat X = load(x + first);
      for (int part = 0; part < PARTS; ++part) {
        const VFloat Y = load(y[part] + first);
        store(d2[part] + first, X * X + Y * Y);
      }
    }
  }
};

// A disc's footprint knows every pixel's place.
template <>
struct BackwardOrigins<Disc> {
  HGS_INLINE void see_from(const DiscSpot&, const TileFrame&) {}
};

template <class Shape>
struct BackwardSums;

template <>
struct BackwardSums<Isotropic> {
  VFloat p{}, px{}, py{}, pd{}, r{}, g{}, b{}, z{};  // px, py, pd: P times a vector's origin

  HGS_INLINE void add(const RoundFootprint&, VFloat P, VFloat red, VFloat green, VFloat blue, VFloat depth,
                      const BackwardOrigins<Isotropic>& origins, std::uint32_t patch, int part) {
    p += P;
    px += P * origins.x[patch];
    py += P * origins.y[part][patch];
    pd += P * origins.d2[part][patch];
    r += red;
    g += green;
    b += blue;
    z += depth;
  }

  // d^2 = X^2 + Y^2 + 2 (X lx + Y ly) + l^2.
  HGS_INLINE void write(float* out) const {
    const VFloat lx = lane_x(), ly = lane_y(), l2 = lx * lx + ly * ly;
    const VFloat sums[8] = {p, px + p * lx, py + p * ly, pd + 2.0f * (px * lx + py * ly) + p * l2, r, g, b, z};
    sum_lanes_of_8(sums, out);
  }
};

template <>
struct BackwardSums<Disc> {
  VFloat p{}, ph{}, py{}, phh{}, phy{}, pyy{}, r{}, g{}, b{}, z{}, zh{}, zy{};

  HGS_INLINE void add(const DiscFootprint& here, VFloat P, VFloat red, VFloat green, VFloat blue, VFloat depth,
                      const BackwardOrigins<Disc>&, std::uint32_t, int) {
    const VFloat Ph = P * here.h, Py = P * here.dy;
    p += P;
    ph += Ph;
    py += Py;
    phh += Ph * here.h;
    phy += Ph * here.dy;
    pyy += Py * here.dy;
    r += red;
    g += green;
    b += blue;
    z += depth;
    zh += depth * here.h;
    zy += depth * here.dy;
  }

  HGS_INLINE void write(float* out) const {
    const VFloat first[8] = {p, ph, py, phh, phy, pyy, r, g}, second[4] = {b, z, zh, zy};
    sum_lanes_of_8(first, out);
    sum_lanes_of_4(second, out + 8);
    __builtin_memset(out + 12, 0, 4 * sizeof(float));
  }
};

}  // namespace hgs::HGS_VARIANT

// The exact Fisher score along sampled rays: what every instruction-set variant provides for it.
#pragma once
#include <cstdint>

#include "rasterise.hpp"

namespace hgs {

inline constexpr int BUNDLE = 16;  // Gaussians that are tested together

// A grid of cells, and the camera that is to look.
struct FisherGrid {
  std::int32_t shape[3];
  float lower[3];  // [m]
  float size;      // edge of a cell [m]
};

struct FisherRule {
  float prior[8];    // lambda of Eq. 9, of each parameter
  float low_pass;    // what a pixel's width adds to a splat's variance, at a focal length of 1
  float saturation;  // nearer than this, a Gaussian scores as from here; 0 = never [m]
  float range;       // of z-depth [m]
  Tangents widest;   // of the camera, see rasterise.hpp; of discs alone
};

// Neighbouring Gaussians. Places that are left over have a decay of -1 and are never met.
struct Bundle {
  float x[BUNDLE], y[BUNDLE], z[BUNDLE];
  float radius2[BUNDLE];
  float decay[BUNDLE];  // 2 ln(255 o): a splat reaches sqrt(decay) standard deviations
  std::uint32_t row[BUNDLE];
  Bundle() {}  // nothing is cleared that is filled next
};

// The normals of a bundle of discs.
struct BundleNormals {
  float x[BUNDLE], y[BUNDLE], z[BUNDLE];
  BundleNormals() {}
};

// Where a bundle's Gaussians reach at most: a sphere, and a box.
struct BundleBounds {
  float centre[3], radius;
  float low[3], high[3];
  BundleBounds() {}
};

// Sixteen bundles that reach into one cell; places that are left over have a radius of -1.
struct BundleList {
  float x[BUNDLE], y[BUNDLE], z[BUNDLE], radius[BUNDLE];
  std::uint32_t bundle[BUNDLE];
};

struct FisherCells {
  FisherGrid grid;
  const std::uint32_t *begin, *end;  // of each cell, in `lists`
  const BundleList* lists;
  const Bundle* bundles;
  const float* parameters;   // (n, 8): centre, rgb, log radius, logit opacity
  const float* information;  // (n, 8): H_train
  const float* normals;      // (n, 3) of discs; null: the Gaussians are isotropic
  const BundleNormals* bundle_normals;  // of discs
};

// Rays from one place. Each is the middle column of a level camera that looks along its azimuth.
struct FisherRays {
  float from[3];
  const float *cosine, *sine;  // of its azimuth
  const float* tangent;        // of its elevation
  int n;
};

// Which ray came across a bundle last: rays are numbered from 1, anew by whoever sets all stamps to 0.
struct RayStamps {
  std::uint32_t* of_bundle;
  std::uint32_t ray;
};

// What a ray scores, for a camera of focal length 1: by moving Gaussians to the side, and by all else. (A camera that
// looks elsewhere sees sideways motion better, see quality.py.)
struct FisherScore {
  float sideways, other;
};

inline constexpr std::uint32_t NO_CELL = 0xffffffffu;

// keys[i]: cell * 64 + which of its 4 x 4 x 4 parts, in Morton order, row i lies in; NO_CELL where it is too faint or
// outside.
using ListCells = void (*)(const float* parameters, std::int32_t n, const FisherGrid& grid, std::uint32_t* keys);
// A bundle of n rows of the map; `normals` (n, 3) and `bundle_normals` of discs, else null.
using MakeBundle = void (*)(const float* parameters, const float* normals, const std::uint32_t* rows, std::int32_t n,
                            const FisherRule& rule, Bundle& bundle, BundleNormals* bundle_normals,
                            BundleBounds& bounds);
// first[r]: the first cell that holds anything on ray r; NO_CELL where there is none.
using FirstCells = void (*)(const FisherCells& cells, const FisherRule& rule, const FisherRays& rays,
                            std::uint32_t* first);
// scores[r]: sum_ik (dC/dw_ik)^2 / (I_ik + prior_k) of ray r.
using ScoreRays = void (*)(const FisherCells& cells, const FisherRule& rule, const FisherRays& rays,
                           RayStamps& stamps, FisherScore* scores);

}  // namespace hgs

// Columns of the map's rows, for work on several Gaussians at once.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "rasterise.hpp"
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

inline constexpr int PADDED_BLOCK = BLOCK + 16;  // columns not a power of two apart

// Parameter k of up to BLOCK rows, padded with the last one to whole vectors.
HGS_INLINE void column_of(const float* parameters, int n, int k, float* column) {
  const int padded = (n + LANES - 1) / LANES * LANES;
  for (int i = 0; i < padded; ++i) column[i] = parameters[N_PARAMETERS * (i < n ? i : n - 1) + k];
}

}  // namespace hgs::HGS_VARIANT

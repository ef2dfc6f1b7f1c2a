// The most arithmetic that one instruction set can do: what kernels are measured against.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

static double multiply_add(std::int64_t rounds) {
  constexpr int CHAINS = 12;  // enough to hide the latency of two units
  double operations = 0.0;
#pragma omp parallel reduction(+ : operations)
  {
    VFloat sums[CHAINS];
    for (int c = 0; c < CHAINS; ++c) sums[c] = splat_all(1.0f + 0.01f * c);
    const VFloat factor = splat_all(0.999f), summand = splat_all(0.001f);
    for (std::int64_t round = 0; round < rounds; ++round) {
      for (int c = 0; c < CHAINS; ++c) sums[c] = sums[c] * factor + summand;
    }
    float kept = 0.0f;
    for (int c = 0; c < CHAINS; ++c) kept += sums[c][0];
    operations += kept > 0.0f ? 2.0 * CHAINS * LANES * static_cast<double>(rounds) : 0.0;
  }
  return operations;
}

}  // namespace hgs::HGS_VARIANT

// Which instruction-set variant runs.
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "variants.hpp"

namespace hgs {

extern const VariantKernels KERNELS_PORTABLE;
#if defined(__x86_64__)
extern const VariantKernels KERNELS_AVX2;
extern const VariantKernels KERNELS_AVX512;
#endif

namespace {

const VariantKernels& choose() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  const bool avx512 = avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
#else
  const bool avx2 = false, avx512 = false;
#endif
  const char* variable = std::getenv("HGS_KERNEL_VARIANT");
  const std::string wanted = variable == nullptr ? "" : variable;
  if (wanted != "" && wanted != "portable" && wanted != "avx2" && wanted != "avx512") {
    throw std::runtime_error("HGS_KERNEL_VARIANT is '" + wanted + "'; there are: portable, avx2, avx512");
  }
  if ((wanted == "avx2" && !avx2) || (wanted == "avx512" && !avx512)) {
    throw std::runtime_error("HGS_KERNEL_VARIANT is '" + wanted + "', which this processor cannot run; it runs: " +
                             (avx2 ? "portable, avx2" : "portable"));
  }
#if defined(__x86_64__)
  if (wanted == "avx512" || (wanted == "" && avx512)) return KERNELS_AVX512;
  if (wanted == "avx2" || (wanted == "" && avx2)) return KERNELS_AVX2;
#endif
  return KERNELS_PORTABLE;
}

}  // namespace

const VariantKernels& variant_kernels() {
  static const VariantKernels& chosen = choose();
  return chosen;
}

}  // namespace hgs

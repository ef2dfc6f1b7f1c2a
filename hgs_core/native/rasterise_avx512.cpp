#define HGS_VARIANT avx512
#include "rasterise_variant.hpp"

namespace hgs {
extern const RasteriseKernels KERNELS_AVX512;
const RasteriseKernels KERNELS_AVX512 = {
    "avx512", avx512::forward, avx512::backward, avx512::optimise, avx512::information, avx512::quality_image,
};
}  // namespace hgs

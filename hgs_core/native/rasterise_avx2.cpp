#define HGS_VARIANT avx2
#include "rasterise_variant.hpp"

namespace hgs {
extern const RasteriseKernels KERNELS_AVX2;
const RasteriseKernels KERNELS_AVX2 = {
    "avx2", avx2::forward, avx2::backward, avx2::optimise, avx2::information, avx2::quality_image,
};
}  // namespace hgs

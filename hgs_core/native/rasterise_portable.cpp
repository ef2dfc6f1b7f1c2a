#define HGS_VARIANT portable
#include "rasterise_variant.hpp"

namespace hgs {
extern const RasteriseKernels KERNELS_PORTABLE;
const RasteriseKernels KERNELS_PORTABLE = {
    "portable", portable::forward, portable::backward, portable::optimise, portable::information, portable::quality_image,
};
}  // namespace hgs

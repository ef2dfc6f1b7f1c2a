#define HGS_VARIANT avx512
#include "fisher_bundles_variant.hpp"
#include "fisher_rays_variant.hpp"
#include "gain_rows_variant.hpp"
#include "multiply_add_variant.hpp"
#include "panorama_variant.hpp"
#include "rasterise_variant.hpp"
#include "triangle_raster_variant.hpp"
#include "variants.hpp"

namespace hgs {
extern const VariantKernels KERNELS_AVX512;
const VariantKernels KERNELS_AVX512 = {
    "avx512",
    avx512::rasterise_kernels_of<Isotropic>(),
    avx512::rasterise_kernels_of<Disc>(),
    {avx512::gather_rows, avx512::march_rays, avx512::list_cells, avx512::make_bundle, avx512::first_cells,
     avx512::score_rays},
    avx512::fill_rows,
    avx512::multiply_add,
};
}  // namespace hgs

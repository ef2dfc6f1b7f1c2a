#define HGS_VARIANT avx2
#include "fisher_bundles_variant.hpp"
#include "fisher_rays_variant.hpp"
#include "gain_rows_variant.hpp"
#include "multiply_add_variant.hpp"
#include "panorama_variant.hpp"
#include "rasterise_variant.hpp"
#include "triangle_raster_variant.hpp"
#include "variants.hpp"

namespace hgs {
extern const VariantKernels KERNELS_AVX2;
const VariantKernels KERNELS_AVX2 = {
    "avx2",
    avx2::rasterise_kernels_of<Isotropic>(),
    avx2::rasterise_kernels_of<Disc>(),
    {avx2::gather_rows, avx2::march_rays, avx2::list_cells, avx2::make_bundle, avx2::first_cells,
     avx2::score_rays},
    avx2::fill_rows,
    avx2::multiply_add,
};
}  // namespace hgs

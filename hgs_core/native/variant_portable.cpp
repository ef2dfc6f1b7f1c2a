#define HGS_VARIANT portable
#include "fisher_bundles_variant.hpp"
#include "fisher_rays_variant.hpp"
#include "gain_rows_variant.hpp"
#include "multiply_add_variant.hpp"
#include "panorama_variant.hpp"
#include "rasterise_variant.hpp"
#include "triangle_raster_variant.hpp"
#include "variants.hpp"

namespace hgs {
extern const VariantKernels KERNELS_PORTABLE;
const VariantKernels KERNELS_PORTABLE = {
    "portable",
    portable::rasterise_kernels_of<Isotropic>(),
    portable::rasterise_kernels_of<Disc>(),
    {portable::gather_rows, portable::march_rays, portable::list_cells, portable::make_bundle, portable::first_cells,
     portable::score_rays},
    portable::fill_rows,
    portable::multiply_add,
};
}  // namespace hgs

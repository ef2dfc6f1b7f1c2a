// What is compiled once per instruction set: the table of entry points that every variant fills.
#pragma once
#include "fisher_rays.hpp"
#include "gain_rows.hpp"
#include "panorama.hpp"
#include "rasterise.hpp"
#include "triangle_raster.hpp"

namespace hgs {

struct GainKernels {
  GatherRows gather;
  MarchRays march;
  ListCells list_cells;
  MakeBundle make_bundle;
  FirstCells first_cells;
  ScoreRays score_rays;
};

struct VariantKernels {
  const char* name;
  RasteriseKernels isotropic, discs;
  GainKernels gain;
  FillRows fill_rows;
  // Runs `rounds` rounds of independent multiply-adds on registers; returns how many floating-point operations
  // that were. What the processor can do at most, for benchmarks.
  double (*multiply_add)(std::int64_t rounds);
};

// The variant chosen for this processor, or by HGS_KERNEL_VARIANT. Throws std::runtime_error when the
// variable names one that does not exist or that the processor cannot run.
const VariantKernels& variant_kernels();

// What draws these rows.
inline const RasteriseKernels& rasterise_kernels(const GaussianRows& rows) {
  return rows.normals == nullptr ? variant_kernels().isotropic : variant_kernels().discs;
}

}  // namespace hgs

#include "bind.hpp"
#include "gain_kernels.hpp"

namespace nb = nanobind;

namespace {

template <class T, class... Shape>
using Array = nb::ndarray<T, Shape..., nb::c_contig, nb::device::cpu>;
template <class T>
using Volume = Array<T, nb::ndim<3>>;
using Rows8 = Array<const float, nb::shape<-1, 8>>;

hgs::Grid grid_of(std::size_t nx, std::size_t ny, std::size_t nz) {
  return {{static_cast<std::int64_t>(nx), static_cast<std::int64_t>(ny), static_cast<std::int64_t>(nz)}};
}

void gather_gaussians(Rows8 parameters, Rows8 information, Array<const float, nb::ndim<1>> information_weight,
                      Array<const float, nb::shape<-1, 6>> block_bounds, std::int64_t block,
                      Array<const double, nb::shape<3>> lower, double cell, double prior, double focal_px,
                      double unseen_quality, double max_quality, double min_opacity, Volume<float> optical_depth, Volume<float> quality,
                      Volume<std::int32_t> count) {
  const std::size_t n = parameters.shape(0);
  if (information.shape(0) != n || information_weight.shape(0) != n) {
    throw nb::value_error("parameters, information and its weight differ in length");
  }
  if (block < 1 || block_bounds.shape(0) * static_cast<std::size_t>(block) < n) {
    throw nb::value_error("block_bounds does not cover all Gaussians");
  }
  for (std::size_t a = 0; a < 3; ++a) {
    if (quality.shape(a) != optical_depth.shape(a) || count.shape(a) != optical_depth.shape(a)) {
      throw nb::value_error("voxel arrays differ in shape");
    }
  }
  const nb::gil_scoped_release unlocked;
  hgs::gather_gaussians(grid_of(optical_depth.shape(0), optical_depth.shape(1), optical_depth.shape(2)),
                        {{lower(0), lower(1), lower(2)}, cell},
                        {parameters.data(), information.data(), information_weight.data(), block_bounds.data(),
                         static_cast<std::int64_t>(n), block},
                        {prior, focal_px, unseen_quality, max_quality, min_opacity}, optical_depth.data(), quality.data(), count.data());
}

void march_panoramas(Array<const float, nb::shape<-1, -1, -1, 3>> cells, Array<const double, nb::shape<-1, 3>> positions,
                     double tan_low, double tan_high, double range, double opaque_below, double saturation,
                     double face_gap,
                     Volume<float> unseen_volume, Volume<float> unseen_voxels, Volume<float> quality) {
  static_assert(sizeof(hgs::PanoramaCell) == 3 * sizeof(float));
  for (std::size_t a = 0; a < 3; ++a) {
    if (unseen_voxels.shape(a) != unseen_volume.shape(a) || quality.shape(a) != unseen_volume.shape(a)) {
      throw nb::value_error("panoramas differ in shape");
    }
  }
  if (unseen_volume.shape(0) != positions.shape(0)) throw nb::value_error("one panorama a position is needed");
  const nb::gil_scoped_release unlocked;
  const hgs::Panorama panorama{static_cast<std::int64_t>(unseen_volume.shape(2)),
                               static_cast<std::int64_t>(unseen_volume.shape(1)),
                               tan_low,
                               tan_high,
                               range,
                               opaque_below,
                               saturation,
                               face_gap};
  hgs::march_panoramas(grid_of(cells.shape(0), cells.shape(1), cells.shape(2)),
                       reinterpret_cast<const hgs::PanoramaCell*>(cells.data()), positions.data(),
                       static_cast<std::int64_t>(positions.shape(0)), panorama, unseen_volume.data(),
                       unseen_voxels.data(), quality.data());
}

}  // namespace

void bind_gain(nb::module_& m) {
  using namespace nb::literals;
  m.def("gather_gaussians", &gather_gaussians, "parameters"_a, "information"_a, "information_weight"_a,
        "block_bounds"_a, "block"_a, "lower"_a, "cell"_a, "prior"_a, "focal_px"_a, "unseen_quality"_a,
        "max_quality"_a, "min_opacity"_a, "optical_depth"_a, "quality"_a, "count"_a, "Add Gaussians to the voxels that hold their centres.");
  m.def("march_panoramas", &march_panoramas, "cells"_a, "positions"_a, "tan_low"_a, "tan_high"_a, "range"_a,
        "opaque_below"_a, "saturation"_a, "face_gap"_a, "unseen_volume"_a, "unseen_voxels"_a, "quality"_a,
        "March panoramas (n, elevation, azimuth) through cells (optical depth, unseen, quality); lengths in cells.");
}

#include "bind.hpp"
#include "gain_kernels.hpp"
#include "rasterise.hpp"

namespace nb = nanobind;

namespace {

template <class T, class... Shape>
using Array = nb::ndarray<T, Shape..., nb::c_contig, nb::device::cpu>;
template <class T>
using Volume = Array<T, nb::ndim<3>>;
template <class T>
using Chunks = Array<T, nb::ndim<2>>;
using Rows8 = Array<const float, nb::shape<-1, 8>>;

hgs::Grid grid_of(std::size_t nx, std::size_t ny, std::size_t nz) {
  return {{static_cast<std::int64_t>(nx), static_cast<std::int64_t>(ny), static_cast<std::int64_t>(nz)}};
}

void gather_gain(Rows8 parameters, Rows8 information, Array<const float, nb::ndim<1>> information_weight,
                 Array<const float, nb::shape<-1, 6>> block_bounds, Volume<const std::uint8_t> states,
                 Volume<const std::uint8_t> attempts, std::uint8_t max_attempts, Array<const double, nb::shape<3>> lower,
                 double cell, float prior, float focal_px, float unseen_quality, float max_quality, float min_opacity,
                 Chunks<const bool> wanted, Array<float, nb::shape<-1, -1, -1, 3>> cells,
                 Chunks<std::int64_t> n_gaussians, Chunks<std::int64_t> n_populated) {
  static_assert(sizeof(hgs::PanoramaCell) == 3 * sizeof(float));
  const std::size_t n = parameters.shape(0);
  if (information.shape(0) != n || information_weight.shape(0) != n) {
    throw nb::value_error("parameters, information and its weight differ in length");
  }
  if (block_bounds.shape(0) * hgs::BLOCK < n) throw nb::value_error("block_bounds does not cover all Gaussians");
  for (std::size_t a = 0; a < 3; ++a) {
    if (attempts.shape(a) != states.shape(a) || cells.shape(a) != states.shape(a)) {
      throw nb::value_error("voxel arrays differ in shape");
    }
  }
  if (cells.size() > 0x7fffffff) throw nb::value_error("too many voxels");
  for (std::size_t a = 0; a < 2; ++a) {
    const std::size_t n_chunks = (states.shape(a) + hgs::CHUNK - 1) / hgs::CHUNK;
    if (wanted.shape(a) != n_chunks || n_gaussians.shape(a) != n_chunks || n_populated.shape(a) != n_chunks) {
      throw nb::value_error("chunk arrays do not fit the voxels");
    }
  }
  const nb::gil_scoped_release unlocked;
  hgs::gather_gain(grid_of(states.shape(0), states.shape(1), states.shape(2)), {{lower(0), lower(1), lower(2)}, cell},
                   {parameters.data(), information.data(), information_weight.data(), block_bounds.data(),
                    static_cast<std::int64_t>(n)},
                   {states.data(), attempts.data(), max_attempts},
                   {prior, focal_px, unseen_quality, max_quality, min_opacity},
                   {{static_cast<std::int64_t>(wanted.shape(0)), static_cast<std::int64_t>(wanted.shape(1))},
                    reinterpret_cast<const std::uint8_t*>(wanted.data()),
                    reinterpret_cast<hgs::PanoramaCell*>(cells.data()), n_gaussians.data(), n_populated.data()});
}

void march_panoramas(Array<const float, nb::shape<-1, -1, -1, 3>> cells, Array<const double, nb::shape<-1, 3>> positions,
                     double tan_low, double tan_high, double range, double opaque_below, double saturation,
                     double face_gap,
                     Volume<float> unseen_volume, Volume<float> unseen_voxels, Volume<float> quality) {
  for (std::size_t a = 0; a < 3; ++a) {
    if (unseen_voxels.shape(a) != unseen_volume.shape(a) || quality.shape(a) != unseen_volume.shape(a)) {
      throw nb::value_error("panoramas differ in shape");
    }
  }
  if (unseen_volume.shape(0) != positions.shape(0)) throw nb::value_error("one panorama a position is needed");
  if (cells.size() > 0x7fffffff) throw nb::value_error("too many voxels");
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

void sample_fisher(Rows8 parameters, Rows8 information, Array<const float, nb::shape<-1, 6>> block_bounds,
                   Array<const double, nb::shape<-1, 3>> positions, double tan_low, double tan_high, double range,
                   float prior, float focal_px, float low_pass_px2, float saturation_m, Volume<float> score) {
  const std::size_t n = parameters.shape(0);
  if (information.shape(0) != n) throw nb::value_error("parameters and information differ in length");
  if (block_bounds.shape(0) * hgs::BLOCK < n) throw nb::value_error("block_bounds does not cover all Gaussians");
  if (score.shape(0) != positions.shape(0)) throw nb::value_error("one panorama a position is needed");
  hgs::Panorama panorama{};
  panorama.n_azimuth = static_cast<std::int64_t>(score.shape(2));
  panorama.n_elevation = static_cast<std::int64_t>(score.shape(1));
  panorama.tan_low = tan_low;
  panorama.tan_high = tan_high;
  panorama.range = range;
  const nb::gil_scoped_release unlocked;
  hgs::sample_fisher({parameters.data(), information.data(), nullptr, block_bounds.data(), static_cast<std::int64_t>(n)},
                     positions.data(), static_cast<std::int64_t>(positions.shape(0)), panorama,
                     {prior, focal_px, low_pass_px2, saturation_m}, score.data());
}

void slide_window(Volume<const float> panoramas, Array<const double, nb::ndim<2>> window,
                  Array<double, nb::ndim<2>> sums) {
  if (window.shape(0) != panoramas.shape(1) || window.shape(1) != panoramas.shape(2) ||
      sums.shape(0) != panoramas.shape(0) || sums.shape(1) != panoramas.shape(2)) {
    throw nb::value_error("the window, the panoramas and the sums do not fit each other");
  }
  const nb::gil_scoped_release unlocked;
  hgs::slide_window(panoramas.data(), static_cast<std::int64_t>(panoramas.shape(0)),
                    static_cast<std::int64_t>(panoramas.shape(1)), static_cast<std::int64_t>(panoramas.shape(2)),
                    window.data(), sums.data());
}

}  // namespace

void bind_gain(nb::module_& m) {
  using namespace nb::literals;
  m.attr("GAIN_CHUNK") = hgs::CHUNK;
  m.def("gather_gain", &gather_gain, "parameters"_a, "information"_a, "information_weight"_a, "block_bounds"_a,
        "states"_a, "attempts"_a, "max_attempts"_a, "lower"_a, "cell"_a, "prior"_a, "focal_px"_a, "unseen_quality"_a,
        "max_quality"_a, "min_opacity"_a, "wanted"_a, "cells"_a, "n_gaussians"_a, "n_populated"_a,
        "Fill the wanted chunks of cells (optical depth, unseen, quality) from both maps.");
  m.def("march_panoramas", &march_panoramas, "cells"_a, "positions"_a, "tan_low"_a, "tan_high"_a, "range"_a,
        "opaque_below"_a, "saturation"_a, "face_gap"_a, "unseen_volume"_a, "unseen_voxels"_a, "quality"_a,
        "March panoramas (n, elevation, azimuth) through cells (optical depth, unseen, quality); lengths in cells.");
  m.def("sample_fisher", &sample_fisher, "parameters"_a, "information"_a, "block_bounds"_a, "positions"_a, "tan_low"_a,
        "tan_high"_a, "range"_a, "prior"_a, "focal_px"_a, "low_pass_px2"_a, "saturation"_a, "score"_a,
        "The exact Fisher score per pixel along each ray of panoramas (n, elevation, azimuth); lengths in metres.");
  m.def("slide_window", &slide_window, "panoramas"_a, "window"_a, "sums"_a,
        "Sum panoramas (n, elevation, azimuth) under a window turned to each azimuth.");
}

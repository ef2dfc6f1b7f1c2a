#include "bind.hpp"
#include <nanobind/stl/array.h>

#include <algorithm>
#include <array>

#include "fisher_field.hpp"
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

// A unit vector a disc, (n, 3); (n, 0) for isotropic Gaussians.
using Normals = Array<const float, nb::ndim<2>>;

hgs::GaussianRows gaussian_rows(const Rows8& parameters, const Array<const float, nb::shape<-1, 6>>& block_bounds) {
  const std::size_t n = parameters.shape(0);
  if (block_bounds.shape(0) * hgs::BLOCK < n) throw nb::value_error("block_bounds does not cover all Gaussians");
  return {parameters.data(), n, block_bounds.data(), nullptr};
}

hgs::GaussianRows with_normals(hgs::GaussianRows rows, const Normals& normals) {
  if (normals.shape(0) != rows.n) throw nb::value_error("normals need a row for every Gaussian");
  if (normals.shape(1) != 0 && normals.shape(1) != hgs::N_NORMAL) throw nb::value_error("a normal has three components");
  if (normals.shape(1) != 0) rows.normals = normals.data();
  return rows;
}

void gather_gain(Rows8 parameters, Array<const float, nb::shape<-1, 6>> block_bounds, Volume<const std::uint8_t> states,
                 Volume<const std::uint8_t> attempts, std::uint8_t max_attempts, Array<const double, nb::shape<3>> lower,
                 double cell, float min_opacity, Chunks<const bool> wanted, Array<float, nb::shape<-1, -1, -1, 2>> cells,
                 Chunks<std::int64_t> n_gaussians, Chunks<std::int64_t> n_populated) {
  static_assert(sizeof(hgs::PanoramaCell) == 2 * sizeof(float));
  const hgs::GaussianRows map = gaussian_rows(parameters, block_bounds);
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
                   map, {states.data(), attempts.data(), max_attempts}, min_opacity,
                   {{{static_cast<std::int64_t>(wanted.shape(0)), static_cast<std::int64_t>(wanted.shape(1))},
                     reinterpret_cast<const std::uint8_t*>(wanted.data())},
                    reinterpret_cast<hgs::PanoramaCell*>(cells.data()), n_gaussians.data(), n_populated.data()});
}

void march_panoramas(Array<const float, nb::shape<-1, -1, -1, 2>> cells, Array<const double, nb::shape<-1, 3>> positions,
                     double tan_low, double tan_high, double range, double opaque_below, double unseen_depth,
                     Volume<float> unseen_volume, Volume<float> unseen_voxels, Volume<float> new_surface,
                     Volume<std::int32_t> first_unseen, Chunks<bool> entered) {
  for (std::size_t a = 0; a < 3; ++a) {
    if (unseen_voxels.shape(a) != unseen_volume.shape(a) || new_surface.shape(a) != unseen_volume.shape(a) ||
        first_unseen.shape(a) != unseen_volume.shape(a)) {
      throw nb::value_error("panoramas differ in shape");
    }
  }
  for (std::size_t a = 0; a < 2; ++a) {
    if (entered.shape(a) != (cells.shape(a) + hgs::CHUNK - 1) / hgs::CHUNK) {
      throw nb::value_error("the chunks do not fit the cells");
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
                               unseen_depth};
  hgs::march_panoramas(grid_of(cells.shape(0), cells.shape(1), cells.shape(2)),
                       reinterpret_cast<const hgs::PanoramaCell*>(cells.data()), positions.data(),
                       static_cast<std::int64_t>(positions.shape(0)), panorama, unseen_volume.data(),
                       unseen_voxels.data(), new_surface.data(), first_unseen.data(),
                       reinterpret_cast<std::uint8_t*>(entered.data()));
}

hgs::FisherField* fisher_field(Array<const std::int64_t, nb::shape<3>> shape, Array<const double, nb::shape<3>> lower,
                               double cell, std::array<float, 8> prior, float low_pass, float saturation, float range,
                               std::array<float, 2> border) {
  hgs::FisherRule rule{{}, low_pass, saturation, range,
                       {hgs::WIDEST_TANGENT * border[0], hgs::WIDEST_TANGENT * border[1]}};
  std::copy(prior.begin(), prior.end(), rule.prior);
  return new hgs::FisherField({{shape(0), shape(1), shape(2)}}, {{lower(0), lower(1), lower(2)}, cell},
                              rule);
}

void gather_fisher(hgs::FisherField& field, Rows8 parameters, Normals normals,
                   Array<const float, nb::shape<-1, 6>> block_bounds, Chunks<const bool> wanted) {
  const hgs::GaussianRows map = with_normals(gaussian_rows(parameters, block_bounds), normals);
  for (int a = 0; a < 2; ++a) {
    if (static_cast<std::int64_t>(wanted.shape(a)) != field.chunks(a)) {
      throw nb::value_error("the chunks do not fit the field");
    }
  }
  const nb::gil_scoped_release unlocked;
  field.gather(map, reinterpret_cast<const std::uint8_t*>(wanted.data()));
}

void score_fisher(const hgs::FisherField& field, Rows8 parameters, Normals normals, Rows8 information,
                  Array<const double, nb::shape<-1, 3>> positions, double tan_low, double tan_high,
                  Array<float, nb::shape<-1, -1, -1, 2>> scores) {
  static_assert(sizeof(hgs::FisherScore) == 2 * sizeof(float));
  if (information.shape(0) != parameters.shape(0)) {
    throw nb::value_error("parameters and information differ in length");
  }
  if (scores.shape(0) != positions.shape(0)) throw nb::value_error("one panorama a position is needed");
  hgs::Panorama panorama{};
  panorama.n_azimuth = static_cast<std::int64_t>(scores.shape(2));
  panorama.n_elevation = static_cast<std::int64_t>(scores.shape(1));
  panorama.tan_low = tan_low;
  panorama.tan_high = tan_high;
  const hgs::GaussianRows map = with_normals({parameters.data(), parameters.shape(0), nullptr, nullptr}, normals);
  const nb::gil_scoped_release unlocked;
  field.score(map, information.data(), positions.data(), static_cast<std::int64_t>(positions.shape(0)),
              panorama, reinterpret_cast<hgs::FisherScore*>(scores.data()));
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
  m.def("gather_gain", &gather_gain, "parameters"_a, "block_bounds"_a, "states"_a, "attempts"_a, "max_attempts"_a,
        "lower"_a, "cell"_a, "min_opacity"_a, "wanted"_a, "cells"_a, "n_gaussians"_a, "n_populated"_a,
        "Fill the wanted chunks of cells (optical depth, unseen) from both maps.");
  m.def("march_panoramas", &march_panoramas, "cells"_a, "positions"_a, "tan_low"_a, "tan_high"_a, "range"_a,
        "opaque_below"_a, "unseen_depth"_a, "unseen_volume"_a, "unseen_voxels"_a, "new_surface"_a, "first_unseen"_a,
        "entered"_a,
        "March panoramas (n, elevation, azimuth) through cells (optical depth, unseen), lengths in cells; flag the "
        "chunks that rays enter.");
  nb::class_<hgs::FisherField>(m, "FisherField", "Gaussians by the cells that they reach into; scores rays exactly.")
      .def(nb::new_(&fisher_field), "shape"_a, "lower"_a, "cell"_a, "prior"_a, "low_pass"_a, "saturation"_a, "range"_a,
           "border"_a,
           "Empty, over a grid of voxels; lengths in metres, low_pass and the image's border (x, y) at a focal length "
           "of 1.")
      .def("clear", &hgs::FisherField::clear, "Forget all Gaussians.")
      .def("gather", &gather_fisher, "parameters"_a, "normals"_a, "block_bounds"_a, "wanted"_a,
           "List the Gaussians of the wanted chunks, which must be empty.")
      .def("score", &score_fisher, "parameters"_a, "normals"_a, "information"_a, "positions"_a, "tan_low"_a, "tan_high"_a,
           "scores"_a,
           "The exact Fisher score per pixel, at a focal length of 1, along each ray of panoramas (n, elevation, "
           "azimuth): by sideways motion, and by all else.");
  m.def("slide_window", &slide_window, "panoramas"_a, "window"_a, "sums"_a,
        "Sum panoramas (n, elevation, azimuth) under a window turned to each azimuth.");
}

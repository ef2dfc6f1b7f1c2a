#include <nanobind/stl/array.h>

#include <array>
#include <stdexcept>
#include <vector>

#include "bind.hpp"
#include "centre_fusion.hpp"
#include "depth_filter.hpp"
#include "gaussian_upkeep.hpp"
#include "surface_normals.hpp"

namespace nb = nanobind;
using nb::ndarray;

namespace {

using Image = ndarray<const std::uint8_t, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using MutableImage = ndarray<std::uint8_t, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Depth = ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using MutableDepth = ndarray<float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

void bind_halve_frame(nb::module_& m) {
  m.def(
      "halve_frame",
      [](Image rgb, Depth depth, float edge_m, MutableImage rgb_half, MutableDepth depth_half) {
        if (rgb.shape(0) != depth.shape(0) || rgb.shape(1) != depth.shape(1) || rgb.shape(2) != 3)
          throw std::invalid_argument("colours and depth differ in height or width");
        if (rgb_half.shape(0) != depth.shape(0) / 2 || rgb_half.shape(1) != depth.shape(1) / 2 || rgb_half.shape(2) != 3 ||
            depth_half.shape(0) != depth.shape(0) / 2 || depth_half.shape(1) != depth.shape(1) / 2)
          throw std::invalid_argument("what is halved needs half the height and width");
        const int height = int(depth.shape(0)), width = int(depth.shape(1));
        nb::gil_scoped_release released;
        hgs::halve_frame(rgb.data(), depth.data(), width, height, edge_m, rgb_half.data(),
                         depth_half.data());
      },
      nb::arg("rgb"), nb::arg("depth"), nb::arg("edge_m"), nb::arg("rgb_half").noconvert(),
      nb::arg("depth_half").noconvert());
}

void bind_smooth_depth(nb::module_& m) {
  m.def(
      "smooth_depth",
      [](Depth depth, int radius, float gate_m, MutableDepth smoothed) {
        if (smoothed.shape(0) != depth.shape(0) || smoothed.shape(1) != depth.shape(1))
          throw std::invalid_argument("depth and smoothed differ in height or width");
        const int height = int(depth.shape(0)), width = int(depth.shape(1));
        nb::gil_scoped_release released;
        hgs::smooth_depth(depth.data(), width, height, radius, gate_m, smoothed.data());
      },
      nb::arg("depth"), nb::arg("radius"), nb::arg("gate_m"), nb::arg("smoothed").noconvert());
}

void bind_surface_normals(nb::module_& m) {
  using Indices = ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
  m.def(
      "surface_normals",
      [](Depth depth, double fx, double fy, double cx, double cy, Indices rows, Indices columns,
         ndarray<double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu> normals) {
        const auto n = static_cast<std::int64_t>(rows.shape(0));
        if (columns.shape(0) != rows.shape(0) || normals.shape(0) != rows.shape(0))
          throw std::invalid_argument("a row, a column and a normal a pixel are needed");
        const hgs::DepthView view{depth.data(), int(depth.shape(1)), int(depth.shape(0)), fx, fy, cx, cy};
        nb::gil_scoped_release released;
        hgs::surface_normals(view, rows.data(), columns.data(), n, normals.data());
      },
      nb::arg("depth"), nb::arg("fx"), nb::arg("fy"), nb::arg("cx"), nb::arg("cy"), nb::arg("rows"), nb::arg("columns"),
      nb::arg("normals").noconvert(), "Unit normals at pixels, in the camera's frame, towards it.");
}

void bind_fuse_centres(nb::module_& m) {
  m.def(
      "fuse_centres",
      [](ndarray<float, nb::shape<-1, 8>, nb::c_contig, nb::device::cpu> parameters,
         ndarray<std::uint16_t, nb::ndim<1>, nb::c_contig, nb::device::cpu> counts,
         ndarray<const float, nb::shape<-1, 6>, nb::c_contig, nb::device::cpu> bounds, int block, Depth depth,
         Depth largest_radius, float fx, float fy, float cx, float cy,
         ndarray<const float, nb::shape<3, 3>, nb::c_contig, nb::device::cpu> rotation,
         ndarray<const float, nb::shape<3>, nb::c_contig, nb::device::cpu> translation, float gate_m,
         float gate_slope, int max_count) {
        if (largest_radius.shape(0) != depth.shape(0) || largest_radius.shape(1) != depth.shape(1)) {
          throw std::invalid_argument("depth and largest_radius differ in height or width");
        }
        const std::size_t n = parameters.shape(0);
        if (block < 1 || counts.shape(0) != n || bounds.shape(0) != (n + std::size_t(block) - 1) / std::size_t(block))
          throw std::invalid_argument("one count a Gaussian and one row of bounds a block are needed");
        auto rows = new std::vector<std::int32_t>();
        nb::capsule owner(rows, [](void* p) noexcept { delete static_cast<std::vector<std::int32_t>*>(p); });
        hgs::FusionView view{depth.data(), largest_radius.data(), int(depth.shape(1)), int(depth.shape(0)), fx, fy, cx, cy, {}, {}};
        for (int k = 0; k < 9; ++k) view.rotation[k] = rotation.data()[k];
        for (int k = 0; k < 3; ++k) view.translation[k] = translation.data()[k];
        {
          nb::gil_scoped_release released;
          hgs::fuse_centres(parameters.data(), counts.data(), long(parameters.shape(0)), bounds.data(), block,
                            view, gate_m, gate_slope, max_count, *rows);
        }
        return ndarray<nb::numpy, std::int32_t, nb::ndim<1>>(rows->data(), {rows->size()}, owner);
      },
      nb::arg("parameters").noconvert(), nb::arg("counts").noconvert(), nb::arg("bounds"), nb::arg("block"),
      nb::arg("depth"), nb::arg("largest_radius"), nb::arg("fx"), nb::arg("fy"), nb::arg("cx"), nb::arg("cy"), nb::arg("rotation"),
      nb::arg("translation"), nb::kw_only(), nb::arg("gate_m"), nb::arg("gate_slope"), nb::arg("max_count"));
}

void bind_bound_blocks(nb::module_& m) {
  m.def(
      "bound_blocks",
      [](ndarray<const float, nb::shape<-1, 8>, nb::c_contig, nb::device::cpu> parameters, std::int64_t block,
         ndarray<float, nb::shape<-1, 6>, nb::c_contig, nb::device::cpu> bounds) {
        const auto n = static_cast<std::int64_t>(parameters.shape(0));
        if (block < 1 || static_cast<std::int64_t>(bounds.shape(0)) != (n + block - 1) / block)
          throw std::invalid_argument("bounds needs one row a block");
        nb::gil_scoped_release released;
        hgs::bound_blocks(parameters.data(), n, block, bounds.data());
      },
      nb::arg("parameters"), nb::arg("block"), nb::arg("bounds").noconvert(),
      "Bounds of each block of rows: its centres, widened by its largest radius.");
}

void bind_compact_rows(nb::module_& m) {
  m.def(
      "compact_rows",
      [](ndarray<std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu> rows,
         ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu> kept) {
        if (kept.shape(0) != rows.shape(0)) throw std::invalid_argument("one flag a row is needed");
        nb::gil_scoped_release released;
        hgs::compact_rows(rows.data(), static_cast<std::int64_t>(rows.shape(0)),
                          static_cast<std::int64_t>(rows.shape(1)), kept.data());
      },
      nb::arg("rows").noconvert(), nb::arg("kept"), "Move the flagged rows, as bytes, together to the front.");
}

void bind_flag_worth_keeping(nb::module_& m) {
  m.def(
      "flag_worth_keeping",
      [](ndarray<const float, nb::shape<-1, 8>, nb::c_contig, nb::device::cpu> parameters, float min_logit_opacity,
         ndarray<const std::uint8_t, nb::ndim<3>, nb::c_contig, nb::device::cpu> states,
         std::array<std::int64_t, 3> origin, double size_m,
         ndarray<bool, nb::ndim<1>, nb::c_contig, nb::device::cpu> kept) {
        if (kept.shape(0) != parameters.shape(0)) throw std::invalid_argument("kept needs one flag a Gaussian");
        const hgs::Grid grid{{static_cast<std::int64_t>(states.shape(0)), static_cast<std::int64_t>(states.shape(1)),
                              static_cast<std::int64_t>(states.shape(2))}};
        nb::gil_scoped_release released;
        hgs::flag_worth_keeping(parameters.data(), static_cast<std::int64_t>(parameters.shape(0)), min_logit_opacity,
                                grid, states.data(), {origin, size_m}, kept.data());
      },
      nb::arg("parameters"), nb::arg("min_logit_opacity"), nb::arg("states"), nb::arg("origin"), nb::arg("size_m"),
      nb::arg("kept").noconvert(), "Flag the Gaussians that are neither faint nor floating in free space.");
}

void bind_count_by_voxel(nb::module_& m) {
  m.def(
      "count_by_voxel",
      [](ndarray<const float, nb::shape<-1, 8>, nb::c_contig, nb::device::cpu> parameters, float min_logit_opacity,
         std::array<std::int64_t, 3> origin, double size_m,
         ndarray<std::int32_t, nb::ndim<3>, nb::c_contig, nb::device::cpu> counts) {
        const hgs::Grid grid{{static_cast<std::int64_t>(counts.shape(0)), static_cast<std::int64_t>(counts.shape(1)),
                              static_cast<std::int64_t>(counts.shape(2))}};
        nb::gil_scoped_release released;
        hgs::count_by_voxel(parameters.data(), static_cast<std::int64_t>(parameters.shape(0)), min_logit_opacity, grid,
                            {origin, size_m}, counts.data());
      },
      nb::arg("parameters"), nb::arg("min_logit_opacity"), nb::arg("origin"), nb::arg("size_m"),
      nb::arg("counts").noconvert(), "Add each Gaussian that is not faint to the count of its voxel.");
}

}  // namespace

void bind_fusion(nb::module_& m) {
  bind_halve_frame(m);
  bind_smooth_depth(m);
  bind_surface_normals(m);
  bind_fuse_centres(m);
  bind_bound_blocks(m);
  bind_compact_rows(m);
  bind_flag_worth_keeping(m);
  bind_count_by_voxel(m);
}

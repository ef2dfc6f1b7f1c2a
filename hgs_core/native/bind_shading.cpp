#include <omp.h>

#include <algorithm>
#include <stdexcept>

#include <nanobind/stl/optional.h>

#include "bind.hpp"
#include "shading.hpp"
#include "triangle_raster.hpp"

namespace nb = nanobind;

namespace {

template <typename T, typename... Shape>
using In = nb::ndarray<const T, Shape..., nb::c_contig, nb::device::cpu>;
template <typename T, typename... Shape>
using Out = nb::ndarray<T, Shape..., nb::c_contig, nb::device::cpu>;
template <typename T>
using Flat = In<T, nb::ndim<1>>;

void shade(In<std::uint32_t, nb::ndim<1>> triangle, In<float, nb::shape<-1, 2>> barycentric, Flat<float> z_depth_m,
           Flat<float> facing, In<float, nb::shape<-1, 3, 2>> uv, In<float, nb::shape<-1, 3>> tint,
           Flat<float> texels_per_metre, Flat<std::int32_t> texture,
           std::optional<In<std::uint8_t, nb::shape<-1, 3, 3>>> corner_rgb, In<std::uint8_t, nb::shape<-1, 3>> texels,
           Flat<std::int64_t> level_offset, Flat<std::int32_t> level_width, Flat<std::int32_t> level_height,
           Flat<std::int32_t> level_first, Flat<std::int32_t> level_count, float focal_px, float range_m,
           In<std::uint8_t, nb::shape<3>> background, Out<std::uint8_t, nb::shape<-1, 3>> rgb, Out<float, nb::ndim<1>> depth_m,
           int threads) {
  const std::size_t n = triangle.shape(0), m = uv.shape(0);
  if (barycentric.shape(0) != n || z_depth_m.shape(0) != n || facing.shape(0) != n || rgb.shape(0) != n ||
      depth_m.shape(0) != n) {
    throw std::invalid_argument("shade: per-ray arrays differ in length");
  }
  if (tint.shape(0) != m || texels_per_metre.shape(0) != m || texture.shape(0) != m ||
      (corner_rgb && corner_rgb->shape(0) != m)) {
    throw std::invalid_argument("shade: per-triangle arrays differ in length");
  }
  const hgs::Appearance appearance{m,
                                   uv.data(),
                                   tint.data(),
                                   texels_per_metre.data(),
                                   texture.data(),
                                   corner_rgb ? corner_rgb->data() : nullptr,
                                   texels.data(),
                                   level_offset.data(),
                                   level_width.data(),
                                   level_height.data(),
                                   level_first.data(),
                                   level_count.data()};
  const hgs::Hits hits{n, triangle.data(), barycentric.data(), z_depth_m.data(), facing.data()};
  nb::gil_scoped_release release;
  hgs::shade(appearance, hits, focal_px, range_m, background.data(), rgb.data(), depth_m.data(),
             threads > 0 ? threads : omp_get_max_threads());
}

// Of a camera that looks from T_world_camera; what looks meet is written to arrays (looks, wanted pixels, ...).
void first_surfaces(In<float, nb::shape<-1, 3>> vertices, In<std::int32_t, nb::shape<-1, 3>> triangles,
                    In<double, nb::shape<3, 3>> rotation, In<double, nb::shape<3>> translation, int width, int height,
                    double fx, double fy, double cx, double cy, In<float, nb::shape<-1, 2>> offsets,
                    std::optional<In<bool, nb::ndim<2>>> wanted, Out<std::uint32_t, nb::ndim<2>> triangle,
                    Out<float, nb::shape<-1, -1, 2>> barycentric, Out<float, nb::ndim<2>> z_depth_m,
                    Out<float, nb::ndim<2>> facing) {
  if (width < 1 || height < 1) throw std::invalid_argument("first_surfaces: a picture has a width and a height");
  if (triangles.shape(0) > std::size_t{1} << 31) throw std::invalid_argument("first_surfaces: too many triangles");
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  const std::uint8_t* mask = nullptr;
  std::size_t n = pixels;
  if (wanted) {
    if (wanted->shape(0) != static_cast<std::size_t>(height) || wanted->shape(1) != static_cast<std::size_t>(width)) {
      throw std::invalid_argument("first_surfaces: what is wanted has the picture's height and width");
    }
    mask = reinterpret_cast<const std::uint8_t*>(wanted->data());
    n = pixels - static_cast<std::size_t>(std::count(mask, mask + pixels, std::uint8_t{0}));
  }
  const auto fits = [&](const auto& array) { return array.shape(0) == offsets.shape(0) && array.shape(1) == n; };
  if (!fits(triangle) || !fits(barycentric) || !fits(z_depth_m) || !fits(facing)) {
    throw std::invalid_argument("first_surfaces: a row a look and a column a wanted pixel are needed");
  }
  nb::gil_scoped_release release;
  hgs::first_surfaces({vertices.data(), static_cast<std::int64_t>(vertices.shape(0)), triangles.data(),
                       static_cast<std::int64_t>(triangles.shape(0))},
                      {width, height, fx, fy, cx, cy, rotation.data(), translation.data()},
                      {offsets.data(), static_cast<int>(offsets.shape(0)), mask, static_cast<std::int64_t>(n)},
                      {triangle.data(), barycentric.data(), z_depth_m.data(), facing.data()});
}

}  // namespace

void bind_shading(nb::module_& m) {
  using namespace nb::literals;
  m.def("shade", &shade, "triangle"_a, "barycentric"_a, "z_depth_m"_a, "facing"_a, "uv"_a, "tint"_a,
        "texels_per_metre"_a, "texture"_a, "corner_rgb"_a.none(), "texels"_a, "level_offset"_a, "level_width"_a,
        "level_height"_a, "level_first"_a, "level_count"_a, "focal_px"_a, "range_m"_a, "background"_a, "rgb"_a, "depth_m"_a,
        "threads"_a = 0, "Colours and z-depths of what looks meet; see shading.cpp.");
  m.def("first_surfaces", &first_surfaces, "vertices"_a, "triangles"_a, "rotation"_a, "translation"_a, "width"_a,
        "height"_a, "fx"_a, "fy"_a, "cx"_a, "cy"_a, "offsets"_a, "wanted"_a.none(), "triangle"_a.noconvert(),
        "barycentric"_a.noconvert(), "z_depth_m"_a.noconvert(), "facing"_a.noconvert(),
        "Which triangle each pixel shows first; see triangle_raster.hpp.");
}

#include <omp.h>

#include <stdexcept>

#include <nanobind/stl/optional.h>

#include "bind.hpp"
#include "shading.hpp"

namespace nb = nanobind;

namespace {

template <typename T, typename... Shape>
using In = nb::ndarray<const T, Shape..., nb::c_contig, nb::device::cpu>;
template <typename T, typename... Shape>
using Out = nb::ndarray<T, Shape..., nb::c_contig, nb::device::cpu>;
template <typename T>
using Flat = In<T, nb::ndim<1>>;

void shade(In<std::uint32_t, nb::ndim<1>> triangle, In<float, nb::shape<-1, 2>> barycentric, Flat<float> z_depth_m,
           In<float, nb::shape<-1, 6>> rays, In<float, nb::shape<-1, 3, 2>> uv, In<float, nb::shape<-1, 3>> normal,
           In<float, nb::shape<-1, 3>> tint, Flat<float> texels_per_metre, Flat<std::int32_t> texture,
           std::optional<In<std::uint8_t, nb::shape<-1, 3, 3>>> corner_rgb, In<std::uint8_t, nb::shape<-1, 3>> texels,
           Flat<std::int64_t> level_offset, Flat<std::int32_t> level_width, Flat<std::int32_t> level_height,
           Flat<std::int32_t> level_first, Flat<std::int32_t> level_count, float focal_px, float range_m,
           In<std::uint8_t, nb::shape<3>> background, Out<std::uint8_t, nb::shape<-1, 3>> rgb, Out<float, nb::ndim<1>> depth_m,
           int threads) {
  const std::size_t n = triangle.shape(0), m = uv.shape(0);
  if (barycentric.shape(0) != n || z_depth_m.shape(0) != n || rays.shape(0) != n || rgb.shape(0) != n ||
      depth_m.shape(0) != n) {
    throw std::invalid_argument("shade: per-ray arrays differ in length");
  }
  if (normal.shape(0) != m || tint.shape(0) != m || texels_per_metre.shape(0) != m || texture.shape(0) != m ||
      (corner_rgb && corner_rgb->shape(0) != m)) {
    throw std::invalid_argument("shade: per-triangle arrays differ in length");
  }
  const hgs::Appearance appearance{m,
                                   uv.data(),
                                   normal.data(),
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
  const hgs::Hits hits{n, triangle.data(), barycentric.data(), z_depth_m.data(), rays.data()};
  nb::gil_scoped_release release;
  hgs::shade(appearance, hits, focal_px, range_m, background.data(), rgb.data(), depth_m.data(),
             threads > 0 ? threads : omp_get_max_threads());
}

}  // namespace

void bind_shading(nb::module_& m) {
  using namespace nb::literals;
  m.def("shade", &shade, "triangle"_a, "barycentric"_a, "z_depth_m"_a, "rays"_a, "uv"_a, "normal"_a, "tint"_a,
        "texels_per_metre"_a, "texture"_a, "corner_rgb"_a.none(), "texels"_a, "level_offset"_a, "level_width"_a,
        "level_height"_a, "level_first"_a, "level_count"_a, "focal_px"_a, "range_m"_a, "background"_a, "rgb"_a, "depth_m"_a,
        "threads"_a = 0, "Colours and z-depths of traced rays; see shading.cpp.");
}

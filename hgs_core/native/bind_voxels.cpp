#include <nanobind/stl/array.h>

#include <array>

#include "bind.hpp"
#include "voxel_kernels.hpp"

namespace nb = nanobind;

namespace {

template <class T>
using Volume = nb::ndarray<T, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Vector3 = nb::ndarray<const double, nb::shape<3>, nb::c_contig, nb::device::cpu>;

template <class T>
hgs::Grid grid_of(const Volume<T>& a) {
  return {{static_cast<std::int64_t>(a.shape(0)), static_cast<std::int64_t>(a.shape(1)),
           static_cast<std::int64_t>(a.shape(2))}};
}

template <class A, class B>
void require_same_shape(const A& a, const B& b) {
  for (std::size_t i = 0; i < 3; ++i)
    if (a.shape(i) != b.shape(i)) throw nb::value_error("voxel arrays differ in shape");
}

using Chunks = nb::ndarray<std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

template <class A>
hgs::ChangedChunks changed_of(const A& states, const Chunks& changed) {
  constexpr std::size_t edge = std::size_t{1} << hgs::kChunkShift;
  for (std::size_t a = 0; a < 2; ++a)
    if (changed.shape(a) != (states.shape(a) + edge - 1) / edge) throw nb::value_error("one flag a chunk is needed");
  return {changed.data(), static_cast<std::int64_t>(changed.shape(1))};
}

std::int64_t integrate_rays(Volume<std::uint8_t> states, Volume<float> log_odds, Vector3 origin,
                    nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu> ends,
                    nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu> is_hit, float hit, float miss,
                    float lowest, float highest, Chunks changed) {
  require_same_shape(states, log_odds);
  if (ends.shape(0) != is_hit.shape(0)) throw nb::value_error("one hit flag a ray end is needed");
  const hgs::ChangedChunks chunks = changed_of(states, changed);
  const nb::gil_scoped_release unlocked;
  return hgs::integrate_rays(grid_of(states), states.data(), log_odds.data(), {origin(0), origin(1), origin(2)}, ends.data(),
                      reinterpret_cast<const std::uint8_t*>(is_hit.data()),
                      static_cast<std::int64_t>(ends.shape(0)), {hit, miss, lowest, highest}, chunks);
}

std::int64_t count_attempts(Volume<const std::uint8_t> states, Volume<std::uint8_t> attempts,
                            nb::ndarray<const double, nb::shape<3, 3>, nb::c_contig, nb::device::cpu> rotation,
                            Vector3 position, double fx, double fy, double cx, double cy,
                            nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu> depth_m, double range_m,
                            double cell_m, double border_px, Chunks changed) {
  require_same_shape(states, attempts);
  if (!(border_px >= 0.0)) throw nb::value_error("the border must not be negative");
  const hgs::ChangedChunks chunks = changed_of(states, changed);
  const nb::gil_scoped_release unlocked;
  hgs::GridCamera camera{{},
                         {position(0), position(1), position(2)},
                         fx,
                         fy,
                         cx,
                         cy,
                         static_cast<std::int64_t>(depth_m.shape(1)),
                         static_cast<std::int64_t>(depth_m.shape(0))};
  for (std::size_t i = 0; i < 9; ++i) camera.rotation[i] = rotation.data()[i];
  return hgs::count_attempts(grid_of(states), states.data(), attempts.data(), camera, depth_m.data(), range_m,
                             cell_m, border_px, chunks);
}

std::int64_t renew_missing(Volume<const std::uint8_t> states, Volume<const std::uint8_t> attempts,
                           std::uint8_t max_attempts, std::int64_t min_cluster, std::array<std::int64_t, 2> low,
                           std::array<std::int64_t, 2> high, Volume<bool> missing,
                           nb::ndarray<std::int32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu> in_columns) {
  require_same_shape(states, attempts);
  require_same_shape(states, missing);
  for (std::size_t a = 0; a < 2; ++a) {
    if (in_columns.shape(a) != states.shape(a)) throw nb::value_error("one sum a column is needed");
    if (low[a] < 0 || high[a] < low[a] || high[a] > static_cast<std::int64_t>(states.shape(a)))
      throw nb::value_error("the box does not lie in the map");
  }
  const nb::gil_scoped_release unlocked;
  return hgs::renew_missing(grid_of(states), states.data(), attempts.data(), max_attempts, min_cluster, {low, high},
                            missing.data(), in_columns.data());
}

void count_in_columns(Volume<const std::uint8_t> values, std::array<std::int64_t, 3> low,
                      std::array<std::int64_t, 3> high, Volume<std::int32_t> counts) {
  for (std::size_t a = 0; a < 3; ++a) {
    if (low[a] < 0 || high[a] < low[a] || high[a] > static_cast<std::int64_t>(values.shape(a))) {
      throw nb::value_error("the box does not lie in the map");
    }
  }
  if (static_cast<std::int64_t>(counts.shape(0)) != high[0] - low[0] ||
      static_cast<std::int64_t>(counts.shape(1)) != high[1] - low[1] || counts.shape(2) != 3) {
    throw nb::value_error("counts needs the box's shape in columns, times 3");
  }
  const nb::gil_scoped_release unlocked;
  hgs::count_in_columns(grid_of(values), values.data(), low, high, counts.data());
}

}  // namespace

void bind_voxels(nb::module_& m) {
  using namespace nb::literals;
  m.def("integrate_rays", &integrate_rays, "states"_a, "log_odds"_a, "origin"_a, "ends"_a, "is_hit"_a, "hit"_a,
        "miss"_a, "lowest"_a, "highest"_a, "changed"_a,
        "Update a log-odds map by rays; coordinates in cells of the arrays. Flags the chunks whose states changed; "
        "returns how many voxels were observed for the first time.");
  m.def("count_attempts", &count_attempts, "states"_a, "attempts"_a, "rotation"_a, "position"_a, "fx"_a, "fy"_a,
        "cx"_a, "cy"_a, "depth_m"_a, "range_m"_a, "cell_m"_a, "border_px"_a, "changed"_a,
        "Count looks in vain at unobserved voxels; the position in cells. Flags their chunks; returns how many.");
  m.def("renew_missing", &renew_missing, "states"_a, "attempts"_a, "max_attempts"_a, "min_cluster"_a, "low"_a,
        "high"_a, "missing"_a, "in_columns"_a,
        "Renew the missing voxels, and how many each column has, after a change in the columns of a box. Returns by "
        "how much their number grew.");
  m.attr("VOXEL_CHUNK") = 1 << hgs::kChunkShift;
  m.def("count_in_columns", &count_in_columns, "values"_a, "low"_a, "high"_a, "counts"_a,
        "Count the voxels of each column of a box that hold 0, 1 and 2.");
}

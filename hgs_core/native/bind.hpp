// One binder a subject; each binds plain C++ functions over NumPy arrays and releases the GIL.
#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstddef>
#include <memory>

// What kernels read: whole rows of a NumPy array, in place.
template <typename T>
using Grid = nanobind::ndarray<const T, nanobind::ndim<2>, nanobind::c_contig, nanobind::device::cpu>;
template <typename T>
using Vector = nanobind::ndarray<const T, nanobind::ndim<1>, nanobind::c_contig, nanobind::device::cpu>;

// A NumPy array that owns `data`.
template <typename T, std::size_t N>
nanobind::ndarray<nanobind::numpy, T, nanobind::ndim<N>> owned(std::unique_ptr<T[]> data,
                                                               const std::size_t (&shape)[N]) {
  T* raw = data.release();
  nanobind::capsule owner(raw, [](void* p) noexcept { delete[] static_cast<T*>(p); });
  return nanobind::ndarray<nanobind::numpy, T, nanobind::ndim<N>>(raw, N, shape, owner);
}

void bind_rasterise(nanobind::module_& m);
void bind_voxels(nanobind::module_& m);
void bind_gain(nanobind::module_& m);
void bind_grid_search(nanobind::module_& m);
void bind_shading(nanobind::module_& m);
void bind_fusion(nanobind::module_& m);
void bind_car(nanobind::module_& m);

// One binder a subject; each binds plain C++ functions over NumPy arrays and releases the GIL.
#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

void bind_rasterise(nanobind::module_& m);
void bind_voxels(nanobind::module_& m);
void bind_gain(nanobind::module_& m);
void bind_grid_search(nanobind::module_& m);
void bind_shading(nanobind::module_& m);
void bind_fusion(nanobind::module_& m);
void bind_car(nanobind::module_& m);

#include "bind.hpp"

void bind_voxels(nanobind::module_& m) { (void)m; }

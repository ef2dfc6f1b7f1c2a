#include "bind.hpp"

void bind_rasterise(nanobind::module_& m) { (void)m; }

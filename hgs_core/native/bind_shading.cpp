#include "bind.hpp"

void bind_shading(nanobind::module_& m) { (void)m; }

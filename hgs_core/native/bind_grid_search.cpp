#include "bind.hpp"

void bind_grid_search(nanobind::module_& m) { (void)m; }

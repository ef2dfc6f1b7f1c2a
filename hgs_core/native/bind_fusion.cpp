#include "bind.hpp"

void bind_fusion(nanobind::module_& m) { (void)m; }

#include "bind.hpp"

void bind_gain(nanobind::module_& m) { (void)m; }

#include <omp.h>

#include "bind.hpp"

NB_MODULE(kernels, m) {
  m.def("set_threads", [](int n) { omp_set_num_threads(n); }, "Number of OpenMP threads of every kernel.");
  m.def("threads", [] { return omp_get_max_threads(); });
  bind_rasterise(m);
  bind_voxels(m);
  bind_gain(m);
  bind_grid_search(m);
  bind_shading(m);
  bind_fusion(m);
  bind_car(m);
}

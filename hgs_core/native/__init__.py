"""The C++ kernels. `hgs_core.native.kernels` is the compiled module."""

import os

# Waiting threads sleep instead of spinning. A mission shares its cores with the planner, the viewer and the
# service: a thread that spins at a barrier holds the core that the thread it waits for needs, and a call then
# takes several times as long. OpenMP reads this once, when the module is loaded; a value set outside wins.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

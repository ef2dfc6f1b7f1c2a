"""A pytest plugin: the tests run on the kernels of the file `HGS_SANITIZED_KERNELS` (see `make sanitize`)."""

import importlib.util
import os
import sys

import hgs_core.native

_spec = importlib.util.spec_from_file_location("hgs_core.native.kernels", os.environ["HGS_SANITIZED_KERNELS"])
assert _spec is not None
assert _spec.loader is not None
_kernels = importlib.util.module_from_spec(_spec)
sys.modules["hgs_core.native.kernels"] = _kernels
_spec.loader.exec_module(_kernels)
hgs_core.native.kernels = _kernels  # type: ignore[attr-defined]

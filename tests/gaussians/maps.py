"""Maps of either primitive, for tests."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray

from hgs_core.gaussians.gaussian_map import GaussianMap, Primitive

PRIMITIVES = pytest.mark.parametrize("primitive", ["isotropic", "disc"])


def gaussian_map(primitive: Primitive, parameters: ndarray, rng: np.random.Generator) -> GaussianMap:
    """A map of these rows (n, 8); discs look anywhere."""
    gaussians = GaussianMap(primitive=primitive)
    normals = None
    if primitive == "disc":
        directions = rng.normal(size=(len(parameters), 3))
        normals = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).astype(np.float32)
    gaussians.append(parameters.astype(np.float32), normals, anchor_keyframe=0)
    return gaussians

"""Whether two depth images show the same surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3


@dataclass(frozen=True, kw_only=True)
class DepthAgreement:
    """How one depth image fits to another under a relative pose."""

    overlap: float
    """Share of the measured pixels that fall on a measured pixel of the other image, 0..1."""
    fitness: float
    """Share of those whose depths agree, 0..1; 0 without overlap."""
    inlier_rmse_m: float
    """Root mean square difference of the depths that agree [m]; 0 where none do."""


def depth_agreement(
    depth_m: Float32[ndarray, "height width"],
    other_m: Float32[ndarray, "rows columns"],
    camera: CameraIntrinsics,
    T_other_this: SE3,
    *,
    other_camera: CameraIntrinsics,
    gate_m: float,
    gate_slope: float,
) -> DepthAgreement:
    """Depths agree when they differ by less than `gate_m + gate_slope * depth`. 0 and +inf are no measure."""
    measured = (depth_m > 0) & np.isfinite(depth_m)
    n_measured = int(measured.sum())
    points = T_other_this.apply(camera.rays()[measured] * depth_m[measured][:, None])
    uv, inside = other_camera.project(points)
    columns, rows = uv[inside].astype(np.int64).T
    theirs = other_m[rows, columns]
    z = points[inside, 2]
    both = (theirs > 0) & np.isfinite(theirs)
    difference = z[both] - theirs[both]
    agreeing = np.abs(difference) < gate_m + gate_slope * theirs[both]
    n_both, n_agreeing = int(both.sum()), int(agreeing.sum())
    return DepthAgreement(
        overlap=n_both / max(n_measured, 1),
        fitness=n_agreeing / max(n_both, 1),
        inlier_rmse_m=float(np.sqrt(np.mean(difference[agreeing] ** 2))) if n_agreeing else 0.0,
    )

"""Quality gain: how much a view would add to what is known of the Gaussians (HGS-Planner Eq. 5-9)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from numpy import ndarray

from hgs_core.gain.panorama import PanoramaGrid, Panoramas, by_yaw
from hgs_core.gaussians.gaussian_map import N_PARAMETERS


def quality_by_yaw(
    grid: PanoramaGrid, panoramas: Panoramas, *, gaussians_per_m2: float
) -> Float64[ndarray, "n n_yaws"]:
    """Quality of the camera at each yaw [m^2 of surface seen once more as well as before].

    The score itself is FisherRF's: `sum_ik H_cand,ik / (H_train,ik + prior)`, `H_cand` foretold from the
    training information (see `GainField`). A Gaussian that is seen once more from where it was seen
    once scores its number of parameters, so a square metre that holds `gaussians_per_m2` scores
    `8 gaussians_per_m2`: dividing by this turns scores into areas, comparable between maps of any density.
    """
    if gaussians_per_m2 == 0:
        return np.zeros((len(panoramas.quality), grid.n_azimuths))
    return by_yaw(panoramas.quality, grid.visible_over_z2) / (N_PARAMETERS * gaussians_per_m2)

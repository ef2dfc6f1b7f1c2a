"""Spread places: at least a spacing apart, in random order (Poisson-disk by dart throwing)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from hgs_core.native import kernels


def poisson_disk(
    points_m: Float[ndarray, "n 2"],
    spacing_m: float,
    rng: np.random.Generator,
    *,
    preferred: Bool[ndarray, " n"] | None = None,
    taken_m: Float[ndarray, "n_taken 2"] | None = None,
    limit: int | None = None,
) -> Int[ndarray, " m"]:
    """Indices of points at least `spacing_m` from each other and from `taken_m`, preferred points first.

    Maximal unless `limit` cuts it: every point left out lies closer than `spacing_m` to a chosen or taken
    one.
    """
    order = rng.permutation(len(points_m))
    if preferred is not None:
        order = np.concatenate([order[preferred[order]], order[~preferred[order]]])
    taken = np.zeros((0, 2)) if taken_m is None else taken_m
    chosen = kernels.throw_darts(
        np.ascontiguousarray(points_m, np.float64),
        order.astype(np.int64),
        np.ascontiguousarray(taken, np.float64),
        spacing_m,
        len(points_m) if limit is None else limit,
    )
    return chosen.astype(np.int64)

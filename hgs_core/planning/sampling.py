"""Spread places: at least a spacing apart, in random order (Poisson-disk by dart throwing)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray


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
    open_ = np.ones(len(points_m), dtype=bool)
    if taken_m is not None:
        for place in taken_m:
            open_ &= np.hypot(*(points_m - place).T) >= spacing_m
    order = rng.permutation(len(points_m))
    if preferred is not None:
        order = np.concatenate([order[preferred[order]], order[~preferred[order]]])
    chosen: list[int] = []
    for index in order:
        if limit is not None and len(chosen) >= limit:
            break
        if open_[index]:
            chosen.append(int(index))
            open_ &= np.hypot(*(points_m - points_m[index]).T) >= spacing_m
    return np.array(chosen, dtype=np.int64)

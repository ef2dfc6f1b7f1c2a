"""Places that are worth scoring: reachable, spread, and near enough to something missing to see it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int
from numpy import ndarray
from scipy.spatial import cKDTree

from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.sampling import poisson_disk

_COLUMN_STEP_M = 0.5
"""Missing columns are thinned to one in this much: distances to them need no more."""


def places_near_missing(
    cycle: PlanningCycle, *, within_m: float, spacing_m: float, rng: np.random.Generator
) -> Int[ndarray, " n"]:
    """Places (flat cells) at most `within_m` from a missing column, at least `spacing_m` apart, the nearest
    to drive to first."""
    places = np.flatnonzero(cycle.is_place)
    columns = np.unique(np.round(cycle.missing.xy_m / _COLUMN_STEP_M), axis=0) * _COLUMN_STEP_M
    if not len(places) or not len(columns):
        return places[:0]
    at_m = cycle.grid.centres_m(places)
    near = np.isfinite(cKDTree(columns).query(at_m, distance_upper_bound=within_m)[0])
    places, at_m = places[near], at_m[near]
    places = places[poisson_disk(at_m, spacing_m, rng, preferred=cycle.is_roomy(places))]
    return places[np.argsort(cycle.reach.distance_m.ravel()[places], kind="stable")]

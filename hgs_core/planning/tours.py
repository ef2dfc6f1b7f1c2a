"""Open tours: in which order to visit places."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from hgs_core.errors import PlanningError
from hgs_core.native import kernels


def open_tour(costs: Float[ndarray, "n n"], *, fixed_end: int | None = None) -> Int[ndarray, " n"]:
    """The cheapest order of all places that begins at place 0 and, if given, ends at `fixed_end`.

    Costs may be asymmetric (turning in place costs time). Exact for up to 11 free places; beyond, 2-opt and
    Or-opt from several starts, within a few percent of the best. Deterministic. Raises `PlanningError` for a
    cost that is not finite: leave out what cannot be reached first.
    """
    if not np.all(np.isfinite(costs)):
        raise PlanningError("a tour needs finite costs between all places: leave out the unreachable ones")
    if fixed_end is not None and not 0 < fixed_end < len(costs):
        raise PlanningError(f"a tour of {len(costs)} places cannot end at place {fixed_end}")
    order, _ = kernels.open_tour(
        np.ascontiguousarray(costs, np.float64), -1 if fixed_end is None else fixed_end
    )
    return order.astype(np.int64)

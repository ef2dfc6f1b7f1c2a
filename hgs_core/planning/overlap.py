"""Views without their overlap: few that show together what many would, each with what it alone adds.

Every place of a room sees the room: fifty views of it, each worth five square metres, are not worth 250. An
order that adds gains up stays where such views are many, and a stop for each of them shows less and less.

What views share is found by cubes of the border of unseen space, through which their rays come into it
(`SurfaceInView`). Of what can be seen behind a cube at all a view shows the share that its area is of the
greatest; several views show the greatest of their shares.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.gain.viewpoint import SurfaceInView


class Overlap:
    """What some views show together. `gains` are the views' own, whatever they consist of; of what a view
    shows behind no cube (quality alone) nothing is shared."""

    def __init__(self, gains: Float[ndarray, " n"], in_view: Sequence[SurfaceInView]) -> None:
        self.gains = gains
        cubes = np.unique(np.concatenate([np.zeros(0, np.int64), *(view.cubes for view in in_view)]))
        self._areas = np.zeros((len(in_view), len(cubes)))
        for row, view in zip(self._areas, in_view, strict=True):
            row[np.searchsorted(cubes, view.cubes)] = view.area_m2
        self._own = self._areas.sum(axis=1)

    def added_to(self, shown: Sequence[int]) -> Float[ndarray, " n"]:
        """The gain of each view that remains when those of the rows `shown` were taken."""
        if not shown:
            return self.gains.copy()
        beyond = np.maximum(self._areas - self._areas[list(shown)].max(axis=0), 0.0).sum(axis=1)
        share = np.divide(beyond, self._own, out=np.ones_like(beyond), where=self._own > 0)
        added: Float[ndarray, " n"] = self.gains * share
        return added


def distinct_views(
    overlap: Overlap,
    away_m: Float[ndarray, " n"],
    *,
    thresholds: Float[ndarray, " n"],
    patience_m: float,
) -> tuple[list[int], Float[ndarray, " m"]]:
    """Rows of views that add at least their thresholds to each other, and what each adds to those before it.

    What adds most for the way to it (and `patience_m` more: how far one goes for the better view) is chosen
    next, until nothing adds its threshold. So what is near is not left out because it will be seen from
    afar, too: a stop on the way costs no way.
    """
    chosen: list[int] = []
    added: list[float] = []
    is_open = np.ones(len(away_m), bool)
    while is_open.any():
        left = overlap.added_to(chosen)
        is_open &= left >= thresholds
        best = int(np.argmax(np.where(is_open, left / (away_m + patience_m), -np.inf)))
        if is_open[best]:
            chosen.append(best)
            added.append(float(left[best]))
            is_open[best] = False
    return chosen, np.array(added, dtype=np.float64)

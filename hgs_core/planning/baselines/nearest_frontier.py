"""Nearest frontier: drive to the nearest place that sees something new, look, repeat.

Yamauchi, "A Frontier-Based Approach for Autonomous Exploration", CIRA 1997. A frontier there is a cell of
the floor plan beside unknown ones; here, where walls and furniture have height, a place counts as one when
its best view newly covers a least volume. Kept of the original: the nearest such place is always next,
however little it shows. Not kept: its laser saw all around; this camera has to turn to the yaw that covers
the most.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from hgs_core.gain.registry import build_evaluator
from hgs_core.planning.baselines.candidates import places_near_missing
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.next_best_view import Choice, NextBestViewConfig, NextBestViewPlanner
from hgs_core.planning.registry import PlannerMethod
from hgs_core.planning.survey import PlannerContext
from hgs_core.planning.views import View

_BATCH = 24
"""Places scored at once, nearest first, until one is a frontier."""


class NearestFrontierConfig(NextBestViewConfig):
    method: Literal["nearest-frontier"] = "nearest-frontier"
    gain_threshold: float = Field(0.2, gt=0)
    """A place is a frontier when its best view gains this much (1 = the gain configuration's scale)."""
    view_radius_m: float = Field(4.0, gt=0)
    """Places farther than this from everything missing are not looked at [m]."""
    spacing_m: float = Field(0.8, gt=0)
    """Least distance between two places [m]."""


class NearestFrontier:
    """The policy; it remembers nothing."""

    def __init__(self, config: NearestFrontierConfig) -> None:
        self._config = config

    def choose(self, cycle: PlanningCycle, rng: np.random.Generator) -> Choice:
        config = self._config
        places = places_near_missing(
            cycle, within_m=config.view_radius_m, spacing_m=config.spacing_m, rng=rng
        )
        rejected: list[View] = []
        for first in range(0, len(places), _BATCH):
            views = cycle.score(places[first : first + _BATCH], coverage_only=True)
            for view in views:  # nearest first
                if view.total_gain >= config.gain_threshold:
                    reason = f"the nearest frontier, {cycle.distance_m(view.cell):.1f} m away"
                    return Choice(stops=[view], rejected=rejected, reason=reason)
                rejected.append(view)
        best = max((view.total_gain for view in rejected), default=0.0)
        return Choice(
            stops=[],
            rejected=rejected,
            reason=f"no frontier is left: none of {len(rejected)} places gains {config.gain_threshold:.2f}, "
            f"the best {best:.2f}",
        )

    def state(self) -> dict[str, Any]:
        return {}

    def restore(self, state: dict[str, Any]) -> None:
        """Nothing to restore."""


def _build(config: NearestFrontierConfig, context: PlannerContext) -> NextBestViewPlanner:
    evaluator = build_evaluator(config.gain, context.camera, context.camera_range_m)
    return NextBestViewPlanner(config, context, evaluator, NearestFrontier(config))


METHOD = PlannerMethod(config=NearestFrontierConfig, build=_build)

"""Random: drive to a random place that sees anything missing, look in a random direction that does, repeat.

The reference below which no planner should fall. It is as good as chance can be: places are drawn among
those that can be reached and lie near something missing, and a draw that sees nothing is drawn again. It ends
when none of all such places, sampled densely, sees anything.
"""

from __future__ import annotations

from dataclasses import replace
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
"""Places scored at once until one sees something."""


class RandomConfig(NextBestViewConfig):
    method: Literal["random"] = "random"
    gain_threshold: float = Field(0.2, gt=0)
    """A yaw sees something when it gains this much (1 = the gain configuration's scale)."""
    view_radius_m: float = Field(4.0, gt=0)
    """Places farther than this from everything missing are not drawn [m]."""
    spacing_m: float = Field(0.5, gt=0)
    """Least distance between two places of the sampling that ends the mission [m]."""


class RandomViews:
    """The policy; it remembers nothing."""

    def __init__(self, config: RandomConfig) -> None:
        self._config = config

    def choose(self, cycle: PlanningCycle, rng: np.random.Generator) -> Choice:
        config = self._config
        near = places_near_missing(cycle, within_m=config.view_radius_m, spacing_m=config.spacing_m, rng=rng)
        places = rng.permutation(near)
        rejected: list[View] = []
        for first in range(0, len(places), _BATCH):
            for view in cycle.score(places[first : first + _BATCH], coverage_only=True):
                yaws = np.flatnonzero(view.total_by_yaw >= config.gain_threshold)
                if len(yaws):
                    chosen = _turned_to(view, int(rng.choice(yaws)))
                    reason = f"drawn from {len(places)} places after {len(rejected)} that see nothing"
                    return Choice(stops=[chosen], rejected=rejected, reason=reason)
                rejected.append(view)
        best = max((view.total_gain for view in rejected), default=0.0)
        return Choice(
            stops=[],
            rejected=rejected,
            reason=f"nothing is left to draw: none of {len(rejected)} places gains "
            f"{config.gain_threshold:.2f}, the best {best:.2f}",
        )

    def state(self) -> dict[str, Any]:
        return {}

    def restore(self, state: dict[str, Any]) -> None:
        """Nothing to restore."""


def _turned_to(view: View, yaw: int) -> View:
    """The view with only that one of its yaws left to choose."""
    only = np.zeros_like(view.total_by_yaw)
    only[yaw] = view.total_by_yaw[yaw]
    share = view.undiscounted_by_yaw[yaw] / view.undiscounted_gain_at(view.yaw_rad)
    return replace(
        view,
        yaw_rad=float(view.yaws_rad[yaw]),
        coverage_gain=float(share * view.coverage_gain),
        total_gain=float(only[yaw]),
        total_by_yaw=only,
    )


def _build(config: RandomConfig, context: PlannerContext) -> NextBestViewPlanner:
    evaluator = build_evaluator(config.gain, context.camera, context.camera_range_m)
    return NextBestViewPlanner(config, context, evaluator, RandomViews(config))


METHOD = PlannerMethod(config=RandomConfig, build=_build)

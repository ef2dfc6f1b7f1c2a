"""Greedy planner: the view that gains most for every metre of the way there is next."""

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


class MostPerMetreConfig(NextBestViewConfig):
    """Settings: `--set planner.gain_threshold=0.1`. Gains, memory and navigation have theirs already."""

    method: Literal["most-per-metre"] = "most-per-metre"  # the entry point's name
    gain_threshold: float = Field(0.2, gt=0)
    """Views that gain less are not worth a way."""


class MostPerMetre:
    """The policy: everything else (floor survey, paths, memory of views) is what all baselines share.

    A planner that shares nothing implements `hgs_core.planning.plan.Planner` instead.
    """

    def __init__(self, config: MostPerMetreConfig) -> None:
        self._config = config

    def choose(self, cycle: PlanningCycle, rng: np.random.Generator) -> Choice:
        places = places_near_missing(cycle, within_m=4.0, spacing_m=1.0, rng=rng)
        views = cycle.score(places)
        worth = [view for view in views if view.total_gain >= self._config.gain_threshold]
        if not worth:
            return Choice(stops=[], rejected=views, reason=f"none of {len(views)} views gains enough")
        best = max(worth, key=lambda view: view.total_gain / (1.0 + cycle.distance_m(view.cell)))
        return Choice(
            stops=[best],
            rejected=[view for view in views if view is not best],
            reason=f"the most for each metre: {best.total_gain:.2f} in {cycle.distance_m(best.cell):.1f} m",
        )

    def state(self) -> dict[str, Any]:
        return {}  # remembers nothing

    def restore(self, state: dict[str, Any]) -> None:
        """Nothing to restore."""


def build(config: MostPerMetreConfig, context: PlannerContext) -> NextBestViewPlanner:
    evaluator = build_evaluator(config.gain, context.camera, context.camera_range_m)
    return NextBestViewPlanner(config, context, evaluator, MostPerMetre(config))


METHOD = PlannerMethod(config=MostPerMetreConfig, build=build)

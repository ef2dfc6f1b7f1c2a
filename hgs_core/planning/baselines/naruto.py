"""NARUTO: go where most of a random few of the most uncertain voxels can be seen from nearby, look at them.

Feng, Zhan et al., "NARUTO: Neural Active Reconstruction from Uncertain Target Observations", CVPR 2024.

Kept of the original, with its numbers:
- an uncertainty grid of 0.1 m; of its 4000 most uncertain voxels 300 are drawn, so that targets do not
  crowd in one place, and positions on a grid of 0.2 m are ranked by the uncertainty of those that they see
  from 0.5 to 2 m, all around;
- the best position is the goal whatever the way to it: what makes its paths long;
- at the goal it looks at its targets one direction after another before it plans again;
- targets that no position can see are filtered out, and the search repeated.

Not kept:
- the map. NARUTO learns the uncertainty of a neural signed distance field; here it is 1 where something is
  missing and the posterior variance of the Gaussians where not (see `hgs_core.gain.uncertainty`). The
  colours' is taken: the centres of Gaussians on plain walls would stay uncertain for ever. Its active choice
  of the rays to learn from belongs to that map, too;
- the RRT in steps of 0.1 m: the navigation grid, of the same step, says what can be reached, and its paths
  are shorter than a tree's, if anything;
- its camera flies at several heights, tilts, and looks at the first target on its way. This one is level and
  looks ahead: distances are horizontal (the floor is in view from 1.8 m on), and directions are yaws.

Added: it ends by itself, not after a number of steps. Voxels of which little is left to learn are no
targets; before nothing is left, targets are drawn from all others, and looked for as far as the camera sees.
"""

from __future__ import annotations

from typing import Any, Final, Literal

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from pydantic import Field
from scipy.spatial import cKDTree

from hgs_core.gain.uncertainty import UncertaintyGain
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.next_best_view import Choice, NextBestViewConfig, NextBestViewPlanner
from hgs_core.planning.pursuit import TAKEN_WITHIN_M
from hgs_core.planning.registry import PlannerMethod
from hgs_core.planning.survey import PlannerContext
from hgs_core.planning.views import View

_TOLD: Final = 40
"""Of the positions of a lattice, so many of the best are told of."""


class NarutoConfig(NextBestViewConfig):
    """Of `gain`, the scale of coverage, the prior information and the bins count here."""

    method: Literal["naruto"] = "naruto"
    top_volume_m3: float = Field(4.0, gt=0)
    """So much of the most uncertain space (the original's 4000 voxels) ..."""
    drawn_voxels: int = Field(300, ge=1)
    """... is drawn from to get so many targets."""
    settled_uncertainty: float = Field(0.3, gt=0, lt=1)
    """Voxels of less uncertainty than this are no targets (1 = nothing is known)."""
    reach_m: tuple[float, float] = (0.5, 2.0)
    """From how near and how far a target is looked at [m]."""
    goal_spacing_m: float = Field(0.2, gt=0)
    """Spacing of the positions that may become a goal [m]."""
    last_spacing_m: float = Field(0.4, gt=0)
    """Their spacing in the last search, before nothing is left [m]."""
    gain_threshold: float = Field(0.2, gt=0)
    """A look must see this much uncertainty (1 = the gain configuration's scale of coverage) ..."""
    last_gain_threshold: float = Field(0.8, gt=0)
    """... and this much in the last search."""
    looks_per_goal: int = Field(10, ge=1)
    """At most so many directions are looked in from one goal."""


class Naruto:
    """The policy. It remembers its goal, and how often it may still look from there."""

    def __init__(self, config: NarutoConfig, gain: UncertaintyGain, context: PlannerContext) -> None:
        self._config = config
        self._gain = gain
        self._range_m = context.camera_range_m
        self._fields_of_view = 2 * np.pi / context.camera.horizontal_fov_rad
        self._goal_m: Float[ndarray, " 2"] = np.full(2, np.inf)
        self._looks_left = 0

    def choose(self, cycle: PlanningCycle, rng: np.random.Generator) -> Choice:
        config = self._config
        look = self._next_look(cycle)
        if look is not None:
            return Choice(stops=[look], reason=f"looking on from the goal (gain {look.total_gain:.2f})")
        uncertain = self._uncertain(cycle, rng)
        of_volume = round(config.top_volume_m3 / cycle.snapshot.voxels.config.size_m**3)
        n_top = min(len(uncertain), max(of_volume, 1))
        drawn = rng.permutation(uncertain[:n_top])[: config.drawn_voxels]
        views = self._views(cycle, drawn, n_top, config.goal_spacing_m, config.reach_m)
        found = f"most uncertainty of {len(drawn)} targets"
        worth = [view for view in views if view.total_gain >= config.gain_threshold]
        if not worth:
            drawn = rng.permutation(uncertain)[: config.drawn_voxels]
            reach_m = (config.reach_m[0], self._range_m)
            views = self._views(cycle, drawn, len(uncertain), config.last_spacing_m, reach_m)
            worth = [view for view in views if view.total_gain >= config.last_gain_threshold]
            found = f"most of what is left, {len(drawn)} targets"
        if not worth:
            gain = max((view.total_gain for view in views), default=0.0)
            why = f"no look gains {config.last_gain_threshold:.2f} from anywhere, the best {gain:.2f}"
            return Choice(stops=[], rejected=views, reason=why)
        goal = max(worth, key=self._over_circle)
        self._goal_m, self._looks_left = goal.xy_m, config.looks_per_goal - 1
        others = sorted(worth, key=self._over_circle, reverse=True)[1:_TOLD]
        reason = f"{found} in view (gain {self._over_circle(goal):.2f})"
        return Choice(stops=[goal], outranked=others, reason=reason)

    def state(self) -> dict[str, Any]:
        return {
            "gain": self._gain.state(),
            "goal_m": self._goal_m.copy(),
            "looks_left": self._looks_left,
        }

    def restore(self, state: dict[str, Any]) -> None:
        self._gain.restore(state["gain"])
        self._goal_m = np.array(state["goal_m"])
        self._looks_left = int(state["looks_left"])

    def _next_look(self, cycle: PlanningCycle) -> View | None:
        """The next direction from the goal, if the robot is there and anything is left to see from it."""
        if self._looks_left and np.linalg.norm(cycle.robot_xy_m - self._goal_m) <= TAKEN_WITHIN_M:
            for view in cycle.score_here():
                if view.total_gain >= self._config.gain_threshold:
                    self._looks_left -= 1
                    return view
        self._looks_left = 0
        return None

    def _uncertain(self, cycle: PlanningCycle, rng: np.random.Generator) -> Int[ndarray, "n 3"]:
        """Array indices of uncertain voxels that some place is near enough to, the most uncertain first,
        equals in random order."""
        places = np.flatnonzero(cycle.is_place)
        uncertainty = self._gain.uncertainty(cycle.snapshot)
        index = rng.permutation(np.argwhere(uncertainty >= self._config.settled_uncertainty))
        if not len(places) or not len(index):
            return index[:0]
        columns = cycle.snapshot.voxels.centres_m(index)[:, :2]
        away, _ = cKDTree(cycle.grid.centres_m(places)).query(columns, distance_upper_bound=self._range_m)
        index = index[np.isfinite(away)]
        return index[np.argsort(-uncertainty[tuple(index.T)], kind="stable")]

    def _views(
        self,
        cycle: PlanningCycle,
        drawn: Int[ndarray, "n 3"],
        n_voxels: int,
        spacing_m: float,
        reach_m: tuple[float, float],
    ) -> list[View]:
        """Views from a lattice of places, by the targets drawn from so many voxels."""
        if not len(drawn):
            return []
        self._gain.aim_at(cycle.snapshot.voxels, drawn, stands_for=n_voxels / len(drawn), reach_m=reach_m)
        grid = cycle.grid
        every = max(1, round(spacing_m / grid.size_m))
        first = np.round(grid.lower_m / grid.size_m).astype(np.int64)  # the lattice stays where it is
        i, j = np.nonzero(cycle.is_place)
        on_lattice = ((i + first[0]) % every == 0) & ((j + first[1]) % every == 0)
        places = i[on_lattice] * grid.shape[1] + j[on_lattice]
        columns = cKDTree(cycle.snapshot.voxels.centres_m(drawn)[:, :2])
        away, _ = columns.query(grid.centres_m(places), distance_upper_bound=reach_m[1])
        return cycle.score(places[np.isfinite(away)])

    def _over_circle(self, view: View) -> float:
        """What all yaws together see."""
        return float(view.total_by_yaw.mean()) * self._fields_of_view


def _build(config: NarutoConfig, context: PlannerContext) -> NextBestViewPlanner:
    gain = UncertaintyGain(config.gain, context.camera)
    return NextBestViewPlanner(config, context, gain, Naruto(config, gain, context))


METHOD = PlannerMethod(config=NarutoConfig, build=_build)

"""ActiveGAMER: look where the rendered map has the most holes, with a coarse pool of views, then a fine one.

Chen et al., "ActiveGAMER: Active GAussian Mapping through Efficient Rendering", CVPR 2025, and its published
settings.

Kept: a view's information is its number of pixels without anything rendered, and the next view has the most
in the whole pool, less with distance; the coarse pool's places lie 1.0 m apart with 5 directions each, the
fine pool's 0.5 m with 15; a place whose views have hardly any holes leaves the pool for good, and a stage
ends when its pool is empty.

Not kept: the paper renders every candidate, here each is a window of a panorama of the voxels (see
`panoramas`): a pixel counts as a hole when more than half of its ray reaches unobserved space in range. What
is empty as far as the camera measures has no hole to fill; the paper's camera has no range, and its pool
asks the simulator for pixels that can never be filled. The camera is level and at one height, so that
directions are yaws and the stages do not differ in height.

Not kept, since the robot does better without: the paper weighs with `1 - softmax(distance)` over the pool,
which is almost 1 for all views but the farthest, and drops views below 0.5 % of holes. In the built-in house
(`robust`) that drives 252 m for an observable completion ratio of 0.936; weighed with
`exp(-distance / 1.5 m)`, 127 m for 0.929, and with 2 % besides, 97 m for 0.920. Post-refinement trains on
keyframes and drives nowhere: the mapper does so all along (`hgs refine` continues it).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final, Literal

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.gain.viewpoint import GainConfig, ViewGains
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.baselines.panoramas import VoxelPanoramas, as_gains
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.next_best_view import Choice, NextBestViewConfig, NextBestViewPlanner
from hgs_core.planning.registry import PlannerMethod
from hgs_core.planning.survey import PlannerContext
from hgs_core.planning.views import View

HOLE_VOXELS: Final = 0.5
"""A ray has a hole when it meets this many unobserved voxels, each weighted with what is left of the ray: the
counterpart of a silhouette below one half."""

Node = tuple[int, int]
"""A place of the pool: its indices in a lattice from the world's origin."""


class StageConfig(StrictConfig):
    """One pool of candidates."""

    spacing_m: float = Field(gt=0)
    """Edge of the lattice of places [m]."""
    directions: int = Field(ge=1)
    """Yaws at each place, evenly spread."""
    hole_share: float = Field(gt=0, lt=1)
    """Places whose views have holes in less than this share of their pixels leave the pool."""


class ActiveGamerConfig(NextBestViewConfig):
    method: Literal["activegamer"] = "activegamer"
    stages: tuple[StageConfig, ...] = (
        StageConfig(spacing_m=1.0, directions=5, hole_share=0.08),
        StageConfig(spacing_m=0.5, directions=15, hole_share=0.02),
    )
    """Coarse to fine."""
    distance_m: float = Field(1.5, gt=0)
    """Path length that counts as 1 in the softmax [m]."""


class HoleEvaluator:
    """A `GainEvaluator`: the share of a view's pixels that are holes."""

    def __init__(self, config: GainConfig, camera: CameraIntrinsics, range_m: float) -> None:
        self._panoramas = VoxelPanoramas(config, camera, range_m)

    def evaluate(
        self,
        snapshot: MapSnapshot,
        positions_m: Float[ndarray, "n 3"],
        *,
        observed_share: float,
        coverage_only: bool = False,
    ) -> ViewGains:
        """See `GainEvaluator`; the total is the share, 0..1."""
        unseen = self._panoramas.unseen(snapshot, positions_m)
        holes = self._panoramas.share_of_image((unseen.unseen_voxels >= HOLE_VOXELS).astype(np.float32))
        return as_gains(self._panoramas.grid.yaws_rad, holes, np.zeros_like(holes), holes)


def preference(hole_shares: Float[ndarray, " n"], distances: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """What the pool's best view maximises; distances are in units of `distance_m`."""
    preferred: Float[ndarray, " n"] = np.exp(-distances) * hole_shares
    return preferred


class HolePools:
    """The policy: the stage that it is in, and the places of that stage that need no more views."""

    def __init__(self, config: ActiveGamerConfig) -> None:
        self._config = config
        self._stage = 0
        self._done: set[Node] = set()

    def choose(self, cycle: PlanningCycle, rng: np.random.Generator) -> Choice:
        rejected: list[View] = []
        while self._stage < len(self._config.stages):
            stage = self._config.stages[self._stage]
            pool, nodes = self._pool(cycle, stage)
            views = [_at_directions(view, stage.directions) for view in cycle.score(pool)]
            shares = np.array([view.total_gain for view in views])
            open_views = np.flatnonzero(shares >= stage.hole_share)
            self._done |= {nodes[i] for i in np.flatnonzero(shares < stage.hole_share)}
            rejected = [view for view, share in zip(views, shares, strict=True) if share < stage.hole_share]
            if len(open_views):
                away = np.array([cycle.distance_m(views[i].cell) for i in open_views])
                best = int(
                    open_views[np.argmax(preference(shares[open_views], away / self._config.distance_m))]
                )
                reason = (
                    f"stage {self._stage + 1} of {len(self._config.stages)}: {shares[best]:.1%} of the view "
                    f"are holes, the most of {len(open_views)} places for their distance"
                )
                others = [views[i] for i in open_views if i != best]
                return Choice(stops=[views[best]], outranked=others, rejected=rejected, reason=reason)
            self._stage += 1
            self._done.clear()
        return Choice(
            stops=[],
            rejected=rejected,
            reason="the pools are empty: no view has holes in "
            f"{self._config.stages[-1].hole_share:.1%} of its pixels",
        )

    def reconsider(self) -> None:
        self._stage = 0
        self._done.clear()

    def state(self) -> dict[str, Any]:
        done = np.array(sorted(self._done), dtype=np.int64).reshape(-1, 2)
        return {"stage": self._stage, "done": done}

    def restore(self, state: dict[str, Any]) -> None:
        self._stage = int(state["stage"])
        self._done = {(int(i), int(j)) for i, j in state["done"]}

    def _pool(self, cycle: PlanningCycle, stage: StageConfig) -> tuple[Int[ndarray, " n"], list[Node]]:
        """The cell nearest to each node of the lattice, for nodes that are not done."""
        places = np.flatnonzero(cycle.is_place)
        at = cycle.grid.centres_m(places) / stage.spacing_m
        nearest = np.round(at).astype(np.int64)
        off = np.linalg.norm(at - nearest, axis=1)
        order = np.lexsort((off, nearest[:, 1], nearest[:, 0]))
        nodes, first = np.unique(nearest[order], axis=0, return_index=True)
        cells = places[order][first]
        keys: list[Node] = [(int(i), int(j)) for i, j in nodes]
        is_open = np.array([key not in self._done for key in keys], dtype=bool)
        return cells[is_open], [key for key, kept in zip(keys, is_open, strict=True) if kept]


def _at_directions(view: View, n: int) -> View:
    """The view at the best of `n` evenly spread yaws."""
    allowed = np.zeros(len(view.yaws_rad), bool)
    allowed[np.round(np.arange(n) * len(allowed) / n).astype(np.int64) % len(allowed)] = True
    totals = np.where(allowed, view.total_by_yaw, 0.0)
    best = int(np.argmax(totals))
    return replace(
        view,
        yaw_rad=float(view.yaws_rad[best]),
        coverage_gain=float(view.undiscounted_by_yaw[best]),
        total_gain=float(totals[best]),
        total_by_yaw=totals,
    )


def _build(config: ActiveGamerConfig, context: PlannerContext) -> NextBestViewPlanner:
    evaluator = HoleEvaluator(config.gain, context.camera, context.camera_range_m)
    return NextBestViewPlanner(config, context, evaluator, HolePools(config))


METHOD = PlannerMethod(config=ActiveGamerConfig, build=_build)

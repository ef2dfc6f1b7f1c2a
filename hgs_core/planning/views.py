"""Views: places with a yaw, what they would gain, and the memory of those already taken."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.gain.viewpoint import GainEvaluator, LocatingEvaluator, SurfaceInView
from hgs_core.geometry.boxes import Box
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.car_ways import CarWays
from hgs_core.planning.plan import Candidate, CandidateStatus
from hgs_core.voxels.voxel_map import VoxelMap

NEAR_BEST = 0.9
"""Yaws within this share of the best gain count as equally good: the one that needs least turning is
taken."""

SURROUNDINGS_M = 2.0
"""How far the surroundings of a refused view reach, along each axis."""

CURRENT_PLACE_M = 0.1
"""A place this near to the robot sees what the robot sees now."""


class ViewMemoryConfig(StrictConfig):
    """A view that was taken is not taken again and again, and a gain that did not drop is believed less."""

    same_place_m: float = Field(0.4, gt=0)
    """Views closer than this ..."""
    same_yaw_deg: float = Field(30.0, gt=0)
    """... and within this angle of one that was taken are discounted."""
    discount: float = Field(0.3, gt=0, lt=1)
    """Factor on the gain for each time such a view was taken: geometric, so that missions end."""
    false_gain_place_m: float = Field(1.5, gt=0)
    """Where a view's gain did not drop when it was taken, views closer than this ..."""
    false_gain_yaw_deg: float = Field(45.0, gt=0)
    """... and within this angle are discounted, too, in proportion to the share of the gain that remained."""
    refused_place_m: float = Field(1.0, gt=0)
    """Views closer than this to one that the operator refused ..."""
    refused_yaw_deg: float = Field(60.0, gt=0)
    """... and within this angle of it gain nothing ..."""
    refused_change: float = Field(0.1, gt=0, lt=1)
    """... until the observed share of what is around it has changed by this much."""


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """A place, and its gain at each yaw (after the memory's discount). The plain gains are those at
    `yaw_rad`."""

    xy_m: Float[ndarray, " 2"]
    cell: int
    """Its cell in the current cycle's grid."""
    yaw_rad: float
    coverage_gain: float
    quality_gain: float
    total_gain: float
    yaws_rad: Float[ndarray, " n_yaws"]
    total_by_yaw: Float[ndarray, " n_yaws"]
    undiscounted_by_yaw: Float[ndarray, " n_yaws"]
    """The evaluator's own totals."""

    def yaw_near(self, heading_rad: float) -> float:
        """Of the yaws about as good as the best, the one nearest to `heading_rad`."""
        good = self.yaws_rad[self.total_by_yaw >= NEAR_BEST * float(np.max(self.total_by_yaw))]
        return float(good[np.argmin(np.abs(wrap_angle(good - heading_rad)))])

    def good_yaws(self, apart_rad: float) -> Float[ndarray, " n"]:
        """Of the yaws about as good as the best, the best and others at least so far apart."""
        kept = [self.yaw_rad]
        for yaw in self.yaws_rad[self.total_by_yaw >= NEAR_BEST * float(np.max(self.total_by_yaw))].tolist():
            if all(turn_rad(yaw, other) >= apart_rad - 1e-9 for other in kept):
                kept.append(yaw)
        return np.array(kept)

    def gain_at(self, yaw_rad: float) -> float:
        """The total gain at the evaluated yaw nearest to `yaw_rad`."""
        return float(self.total_by_yaw[self._nearest(yaw_rad)])

    def undiscounted_gain_at(self, yaw_rad: float) -> float:
        """The evaluator's own total there."""
        return float(self.undiscounted_by_yaw[self._nearest(yaw_rad)])

    def _nearest(self, yaw_rad: float) -> int:
        return int(np.argmin(np.abs(wrap_angle(self.yaws_rad - yaw_rad))))

    def at_cell(self, cell: int) -> View:
        """The same view in another cycle's grid."""
        return replace(self, cell=cell)

    def state(self) -> dict[str, Any]:
        """Plain data; the cell belongs to one cycle and is left out."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "cell"}

    @staticmethod
    def restore(state: dict[str, Any]) -> View:
        return View(**state, cell=-1)

    def as_candidate(self, status: CandidateStatus, z_m: float, why: str = "") -> Candidate:
        return Candidate(
            x_m=float(self.xy_m[0]),
            y_m=float(self.xy_m[1]),
            z_m=z_m,
            yaw_rad=self.yaw_rad,
            coverage_gain=self.coverage_gain,
            quality_gain=self.quality_gain,
            total_gain=self.total_gain,
            status=status,
            why=why,
        )


class ViewMemory:
    """Which views have been taken on purpose, and what became of their gain."""

    def __init__(self, config: ViewMemoryConfig) -> None:
        self.config = config
        self.taken: Float[ndarray, "n 4"] = np.zeros((0, 4))
        """x [m], y [m], yaw [rad] of each, and the share of the predicted gain that remained afterwards."""
        self.current: tuple[float, float, float] | None = None
        """The robot's pose when it last planned: what it sees from there is already in the map."""
        self.refused: Float[ndarray, "n 4"] = np.zeros((0, 4))
        """x [m], y [m], yaw [rad] of each view that the operator refused, and `observed_around` it then."""

    def add(self, x_m: float, y_m: float, yaw_rad: float, *, remaining_share: float) -> None:
        """A view was taken. `remaining_share`: its gain now over the gain predicted, cut to 0..1."""
        self.taken = np.concatenate([self.taken, [[x_m, y_m, yaw_rad, np.clip(remaining_share, 0.0, 1.0)]]])

    def refuse(self, x_m: float, y_m: float, yaw_rad: float, *, observed: float) -> None:
        """The operator does not want this view; `observed` is what `observed_around` gives there now."""
        self.refused = np.concatenate([self.refused, [[x_m, y_m, yaw_rad, observed]]])

    def forget_refusals(self, observed: Callable[[float, float], float]) -> None:
        """Of views whose surroundings have changed."""
        if len(self.refused):
            now = np.array([observed(x_m, y_m) for x_m, y_m in self.refused[:, :2].tolist()])
            self.refused = self.refused[np.abs(now - self.refused[:, 3]) < self.config.refused_change]

    def is_refused(self, x_m: float, y_m: float, yaw_rad: float) -> bool:
        """Whether the operator does not want such a view."""
        place, yaw = np.array([[x_m, y_m]]), np.array([yaw_rad])
        return bool(self._refused(place, yaw)[0, 0])

    def _refused(
        self, places_m: Float[ndarray, "n 2"], yaws_rad: Float[ndarray, " n_yaws"]
    ) -> Bool[ndarray, "n n_yaws"]:
        apart = np.linalg.norm(places_m[:, None] - self.refused[None, :, :2], axis=2)
        turned = np.abs(wrap_angle(yaws_rad[:, None] - self.refused[None, :, 2]))
        once = np.ones(len(self.refused))
        config = self.config
        matches = _matches(apart, config.refused_place_m, turned, config.refused_yaw_deg, once)
        refused: Bool[ndarray, "n n_yaws"] = matches > 0
        return refused

    def factors(
        self, places_m: Float[ndarray, "n 2"], yaws_rad: Float[ndarray, " n_yaws"]
    ) -> Float[ndarray, "n n_yaws"]:
        """What a gain at each place and yaw is multiplied by."""
        config = self.config
        apart = np.linalg.norm(places_m[:, None] - self.taken[None, :, :2], axis=2)
        turned = np.abs(wrap_angle(yaws_rad[:, None] - self.taken[None, :, 2]))
        once = np.ones(len(self.taken))
        times = _matches(apart, config.same_place_m, turned, config.same_yaw_deg, once)
        false = _matches(
            apart, config.false_gain_place_m, turned, config.false_gain_yaw_deg, self.taken[:, 3]
        )
        factors: Float[ndarray, "n n_yaws"] = config.discount ** np.maximum(times, false)
        if self.current is not None:
            x_m, y_m, yaw_rad = self.current
            at = np.hypot(places_m[:, 0] - x_m, places_m[:, 1] - y_m) < CURRENT_PLACE_M
            same = np.abs(wrap_angle(yaws_rad - yaw_rad)) < np.radians(config.same_yaw_deg)
            factors[np.ix_(at, same)] = 0.0
        if len(self.refused):
            factors[self._refused(places_m, yaws_rad)] = 0.0
        return factors

    def state(self) -> dict[str, Any]:
        return {"taken": self.taken.copy(), "current": self.current, "refused": self.refused.copy()}

    def restore(self, state: dict[str, Any]) -> None:
        self.taken = np.array(state["taken"])
        self.current = None if state["current"] is None else tuple(state["current"])
        self.refused = np.array(state["refused"]).reshape(-1, 4)


def observed_around(voxels: VoxelMap, x_m: float, y_m: float) -> float:
    """The observed share of the columns around a place."""
    lower = np.asarray(voxels.lower_m(), np.float64)
    top = lower[2] + voxels.states.shape[2] * voxels.config.size_m
    return voxels.observed_share(
        Box(
            lower_m=np.array([x_m - SURROUNDINGS_M, y_m - SURROUNDINGS_M, lower[2]]),
            upper_m=np.array([x_m + SURROUNDINGS_M, y_m + SURROUNDINGS_M, top]),
        )
    )


def _matches(
    apart_m: Float[ndarray, "n n_taken"],
    within_m: float,
    turned_rad: Float[ndarray, "n_yaws n_taken"],
    within_deg: float,
    weights: Float[ndarray, " n_taken"],
) -> Float[ndarray, "n n_yaws"]:
    """The weights of the taken views near each place and yaw, summed."""
    near = (apart_m < within_m) * weights
    matches: Float[ndarray, "n n_yaws"] = near @ (turned_rad < np.radians(within_deg)).T.astype(np.float64)
    return matches


class ViewScorer:
    """The gain evaluator with the memory's discount, on a clock of its own (T_VE)."""

    def __init__(self, evaluator: GainEvaluator, memory: ViewMemory, camera_height_m: float) -> None:
        self.memory = memory
        self.camera_height_m = camera_height_m
        self.elapsed_s = 0.0
        """Wall seconds spent evaluating since it was last set to 0."""
        self.car: CarWays | None = None
        """Where the robot is a car: views are from poses alone that it can get to."""
        self._evaluator = evaluator

    def score(
        self,
        snapshot: MapSnapshot,
        places_m: Float[ndarray, "n 2"],
        cells: list[int],
        observed_share: float,
        *,
        coverage_only: bool = False,
    ) -> list[View]:
        """One view a place, at its best yaw; see `GainEvaluator.evaluate`."""
        if not len(places_m):
            return []
        started = time.perf_counter()
        positions = np.column_stack([places_m, np.full(len(places_m), self.camera_height_m)])
        gains = self._evaluator.evaluate(
            snapshot, positions, observed_share=observed_share, coverage_only=coverage_only
        )
        totals = np.asarray(gains.total_by_yaw) * self.memory.factors(places_m, gains.yaws_rad)
        if self.car is not None:
            stands = self.car.may_stand(np.array(cells), places_m, gains.yaws_rad)
            totals = totals * (stands | (np.array(cells) < 0)[:, None])
        best = np.argmax(totals, axis=1)
        views = [
            View(
                xy_m=places_m[i],
                cell=cells[i],
                yaw_rad=float(gains.yaws_rad[best[i]]),
                coverage_gain=float(gains.coverage_by_yaw[i, best[i]]),
                quality_gain=float(gains.quality_by_yaw[i, best[i]]),
                total_gain=float(totals[i, best[i]]),
                yaws_rad=gains.yaws_rad,
                total_by_yaw=totals[i],
                undiscounted_by_yaw=gains.total_by_yaw[i],
            )
            for i in range(len(places_m))
        ]
        self.elapsed_s += time.perf_counter() - started
        return views

    def new_surface_in_view(self, snapshot: MapSnapshot, views: list[View]) -> list[SurfaceInView]:
        """Where each view, at its best yaw, would see new surface: nowhere, as far as an evaluator knows that
        cannot locate it."""
        if not isinstance(self._evaluator, LocatingEvaluator) or not views:
            nowhere = SurfaceInView(cubes=np.zeros(0, np.int64), area_m2=np.zeros(0))
            return [nowhere] * len(views)
        started = time.perf_counter()
        positions = np.array([[*view.xy_m, self.camera_height_m] for view in views])
        located = self._evaluator.new_surface_in_view(
            snapshot, positions, np.array([view.yaw_rad for view in views])
        )
        self.elapsed_s += time.perf_counter() - started
        return located


def wrap_angle(angle_rad: Float[ndarray, "*shape"]) -> Float[ndarray, "*shape"]:
    """To [-pi, pi)."""
    wrapped: Float[ndarray, "*shape"] = (angle_rad + np.pi) % (2 * np.pi) - np.pi
    return wrapped


def turn_rad(from_rad: float, to_rad: float) -> float:
    """The unsigned angle between two headings."""
    return abs((to_rad - from_rad + np.pi) % (2 * np.pi) - np.pi)

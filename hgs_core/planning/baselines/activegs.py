"""ActiveGS: the view with the most unseen space and the least confident surface, for the way there.

Jin et al., "ActiveGS: Active Scene Reconstruction Using Gaussian Splatting", RA-L 2025, and its published
settings.

Kept: a view's utility is `1000 * (unseen voxels in view / all voxels) + (1 - mean confidence in view)` (the
constant 1 for the paper's `- mean confidence` keeps utilities positive, as the next step needs); of up to 100
candidates, about 30 stand around regions of interest, at most 2 m from a surface of low confidence or near
what is unexplored, the rest close to the robot; the next view maximises `U / sum(U) - 0.5 L / sum(L)`, `L`
being the lengths of the ways. A Gaussian is confident when it was seen often, from near and head-on.

Not kept: the paper's map stores viewing directions and normals, its confidence `exp(1 - |mean direction|)
sum_views (1 - d / range) cos(incidence)`, cut to 1. Here the Fisher information of the colours, which the
mapper sums over all frames, takes the place of the sum: each frame adds `focal^2 cos(incidence) / d^2` per
area of surface. How the directions spread is not known. Confidence is that of voxels, in two steps, seen
along panoramas instead of rendered (see `panoramas`). The camera is level. The paper spends a time budget;
here the mission ends when no candidate has `explore_m3` of unseen space or `exploit_share` of unconfident
image left.
"""

from __future__ import annotations

from typing import Any, Final, Literal

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numpy import ndarray
from pydantic import Field
from scipy.spatial import cKDTree

from hgs_core.gain.viewpoint import ViewGains
from hgs_core.gaussians.gaussian_map import RGB
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.baselines.candidates import places_near_missing
from hgs_core.planning.baselines.panoramas import VoxelPanoramas, as_gains
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.next_best_view import Choice, NextBestViewConfig, NextBestViewPlanner
from hgs_core.planning.registry import PlannerMethod
from hgs_core.planning.sampling import poisson_disk
from hgs_core.planning.survey import PlannerContext
from hgs_core.planning.views import View
from hgs_core.voxels.voxel_map import VoxelState

CONFIDENCE_STEPS: Final = (0.25, 0.75)
"""Thresholds; the mean of the shares below them is the mean of `1 - confidence`, to within a quarter."""


class ActiveGsConfig(NextBestViewConfig):
    method: Literal["activegs"] = "activegs"
    explore_weight: float = Field(1000.0, gt=0)
    """Of the share of all voxels that a view newly sees."""
    path_weight: float = Field(0.5, ge=0)
    """Of a way's share of the lengths of all ways."""
    confident_looks: float = Field(2.0, gt=0)
    """Confidence is 1 from so many frames on, head-on from half the camera's range."""
    roi_candidates: int = Field(60, ge=1)
    """At most so many candidates around regions of interest, the nearest first."""
    near_candidates: int = Field(20, ge=0)
    """At most so many candidates around the robot."""
    roi_distance_m: float = Field(2.0, gt=0)
    """How far from an unconfident surface its candidates stand [m]."""
    unseen_distance_m: float = Field(4.0, gt=0)
    """How far from unexplored space its candidates stand [m]."""
    near_m: float = Field(1.5, gt=0)
    """The candidates around the robot stand no farther from it [m]."""
    spacing_m: float = Field(0.6, gt=0)
    """Least distance between two candidates [m]."""
    explore_m3: float = Field(0.1, gt=0)
    """A view that newly sees less than this is not worth a stop for exploration [m^3]."""
    exploit_share: float = Field(0.3, gt=0, le=1)
    """A view with less mean `1 - confidence` than this is not worth a stop for quality."""


def voxel_confidence(
    snapshot: MapSnapshot, *, focal_px: float, range_m: float, confident_looks: float
) -> Float32[ndarray, "nx ny nz"]:
    """Confidence 0..1 of what each voxel holds; 1 where there are no Gaussians.

    A frame leaves `focal^2 cos(incidence) / d^2` of colour information per area of surface, so that
    `H / (focal^2 size^2)` is a sum of `cos / d^2` over the frames that saw a voxel, and `confident_looks`
    head-on frames from half of `range_m` make 1.
    """
    voxels, gaussians = snapshot.voxels, snapshot.gaussians
    shape = voxels.states.shape
    information = gaussians.information[: gaussians.size, RGB].mean(axis=1, dtype=np.float64)
    index, inside = voxels.index_of(gaussians.centres_m.astype(np.float64))
    flat = np.ravel_multi_index(tuple(index[inside].T), shape)
    total = np.bincount(flat, weights=information[inside], minlength=voxels.states.size)
    held = np.bincount(flat, minlength=voxels.states.size) > 0
    of_one_look = (focal_px * voxels.config.size_m) ** 2 / (range_m / 2.0) ** 2
    confidence = np.where(held, np.minimum(total / (confident_looks * of_one_look), 1.0), 1.0)
    return confidence.reshape(shape).astype(np.float32)


class UtilityEvaluator:
    """A `GainEvaluator`: ActiveGS's utility. Coverage is in m^3, quality the mean `1 - confidence` of the
    image."""

    def __init__(self, config: ActiveGsConfig, camera: CameraIntrinsics, range_m: float) -> None:
        self._config = config
        self._focal_px = float(np.sqrt(camera.fx * camera.fy))
        self._panoramas = VoxelPanoramas(config.gain, camera, range_m)
        self._surface: Float32[ndarray, "nx ny nz"] | None = None
        self._surface_of: MapSnapshot | None = None

    def evaluate(
        self,
        snapshot: MapSnapshot,
        positions_m: Float[ndarray, "n 3"],
        *,
        observed_share: float,
        coverage_only: bool = False,
    ) -> ViewGains:
        """See `GainEvaluator`."""
        panoramas = self._panoramas
        explore = panoramas.volume_m3(panoramas.unseen(snapshot, positions_m))
        shares = [
            panoramas.share_of_image(
                np.minimum(panoramas.marked(snapshot, positions_m, marked).unseen_voxels, 1.0)
            )
            for marked in (self.unconfident(snapshot, step) for step in CONFIDENCE_STEPS)
        ]
        exploit = np.mean(shares, axis=0)
        everything_m3 = snapshot.voxels.states.size * snapshot.voxels.config.size_m**3
        utility = self._config.explore_weight * explore / everything_m3 + exploit
        return as_gains(panoramas.grid.yaws_rad, explore, exploit, utility)

    def unconfident(self, snapshot: MapSnapshot, below: float) -> Bool[ndarray, "nx ny nz"]:
        """Occupied voxels with less confidence than `below`."""
        if self._surface is None or not _same_maps(self._surface_of, snapshot):
            self._surface = voxel_confidence(
                snapshot,
                focal_px=self._focal_px,
                range_m=self._panoramas.range_m,
                confident_looks=self._config.confident_looks,
            )
            self._surface_of = snapshot
        low: Bool[ndarray, "nx ny nz"] = self._surface < below
        return low & (snapshot.voxels.states == VoxelState.OCCUPIED)


def _same_maps(one: MapSnapshot | None, other: MapSnapshot) -> bool:
    return (
        one is not None
        and one.version == other.version
        and one.voxels is other.voxels
        and one.gaussians is other.gaussians
    )


def scores(
    utilities: Float[ndarray, " n"], lengths_m: Float[ndarray, " n"], *, path_weight: float
) -> Float[ndarray, " n"]:
    """`U / sum(U) - path_weight L / sum(L)` over all candidates."""
    total_m = lengths_m.sum()
    ways = lengths_m / total_m if total_m > 0 else lengths_m
    scored: Float[ndarray, " n"] = utilities / utilities.sum() - path_weight * ways
    return scored


class RegionsOfInterest:
    """The policy; it remembers nothing."""

    def __init__(self, config: ActiveGsConfig, evaluator: UtilityEvaluator) -> None:
        self._config = config
        self._evaluator = evaluator

    def choose(self, cycle: PlanningCycle, rng: np.random.Generator) -> Choice:
        views = cycle.score(self._candidates(cycle, rng))
        worthy = [view for view in views if self._is_worth_a_stop(view)]
        rejected = [view for view in views if not self._is_worth_a_stop(view)]
        if not worthy:
            return Choice(
                stops=[],
                rejected=rejected,
                reason=f"none of {len(rejected)} candidates newly sees {self._config.explore_m3:.2f} m^3 "
                f"or has {self._config.exploit_share:.0%} of its image unconfident",
            )
        lengths = np.array([cycle.distance_m(view.cell) for view in worthy])
        utilities = np.array([view.total_gain for view in worthy])
        best = int(np.argmax(scores(utilities, lengths, path_weight=self._config.path_weight)))
        view = worthy[best]
        reason = (
            f"utility {view.total_gain:.2f} ({view.coverage_gain:.2f} m^3 unseen, {view.quality_gain:.0%} "
            f"unconfident), the best of {len(worthy)} for the way of {lengths[best]:.1f} m"
        )
        others = worthy[:best] + worthy[best + 1 :]
        return Choice(stops=[view], outranked=others, rejected=rejected, reason=reason)

    def state(self) -> dict[str, Any]:
        return {}

    def restore(self, state: dict[str, Any]) -> None:
        """Nothing to restore."""

    def _is_worth_a_stop(self, view: View) -> bool:
        undiscounted = view.undiscounted_gain_at(view.yaw_rad)
        believed = view.total_gain / undiscounted if undiscounted > 0 else 0.0
        config = self._config
        return (
            believed * view.coverage_gain >= config.explore_m3
            or believed * view.quality_gain >= config.exploit_share
        )

    def _candidates(self, cycle: PlanningCycle, rng: np.random.Generator) -> Int[ndarray, " n"]:
        config = self._config
        unseen = places_near_missing(
            cycle, within_m=config.unseen_distance_m, spacing_m=config.spacing_m, rng=rng
        )
        roi = np.unique(np.concatenate([unseen, self._near_unconfident(cycle, rng)]))
        roi = roi[np.argsort(cycle.reach.distance_m.ravel()[roi], kind="stable")][: config.roi_candidates]
        around = cycle.places_within(cycle.robot_xy_m, config.near_m)
        near = around[
            poisson_disk(cycle.grid.centres_m(around), config.spacing_m, rng, limit=config.near_candidates)
        ]
        return np.unique(np.concatenate([roi, near]))

    def _near_unconfident(self, cycle: PlanningCycle, rng: np.random.Generator) -> Int[ndarray, " n"]:
        """Places near an unconfident surface."""
        voxels = cycle.snapshot.voxels
        columns = np.argwhere(self._evaluator.unconfident(cycle.snapshot, CONFIDENCE_STEPS[0]).any(axis=2))
        places = np.flatnonzero(cycle.is_place)
        if not len(columns) or not len(places):
            return places[:0]
        surface_m = voxels.lower_m()[:2] + (columns + 0.5) * voxels.config.size_m
        away, _ = cKDTree(surface_m).query(
            cycle.grid.centres_m(places), distance_upper_bound=self._config.roi_distance_m
        )
        places = places[np.isfinite(away)]
        spread = poisson_disk(
            cycle.grid.centres_m(places), self._config.spacing_m, rng, preferred=cycle.is_roomy(places)
        )
        return places[spread]


def _build(config: ActiveGsConfig, context: PlannerContext) -> NextBestViewPlanner:
    evaluator = UtilityEvaluator(config, context.camera, context.camera_range_m)
    return NextBestViewPlanner(config, context, evaluator, RegionsOfInterest(config, evaluator))


METHOD = PlannerMethod(config=ActiveGsConfig, build=_build)

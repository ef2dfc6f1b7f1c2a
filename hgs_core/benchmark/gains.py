"""`hgs bench gains`: do the planner's gains rank views as the exact scores do, in the map of a mission?"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from pydantic import BaseModel, ConfigDict
from scipy.stats import spearmanr

import hgs_core.native.kernels as kernels
from hgs_core.errors import PlanningError
from hgs_core.gain.evaluator import PanoramaGainEvaluator
from hgs_core.gain.exact import exact_coverage, exact_quality
from hgs_core.gain.viewpoint import CoverageMeasure
from hgs_core.geometry.camera import level_camera_pose
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.mission.build import build_mission
from hgs_core.mission.commands import CommandSource
from hgs_core.mission.config import MissionConfig, resolve_mission_config
from hgs_core.mission.events import MissionEvent, MissionObserver, MissionView, PlanMade
from hgs_core.mission.request import MissionRequest
from hgs_core.planning.plan import CandidateStatus
from hgs_core.planning.views import wrap_angle

CASE_SIZE: Final = 20
"""Views in one case of "is the best among the first three?": about as many as a planning cycle weighs."""
N_CASES: Final = 100
AMONG_FIRST: Final = 3
NOTHING_BELOW: Final = 1e-3
"""Scores below this share of the best one's are as good as nothing."""


class _Figures(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class GainFidelity(_Figures):
    """One gain against its exact value over all views."""

    spearman: float
    """Rank correlation over all views."""
    n_gaining: int
    """Views whose exact score is more than a thousandth of the best one's."""
    spearman_gaining: float
    """Rank correlation over these: views that gain nothing are equal, and their order is noise."""
    best_among_first: float
    """Share of cases of 20 views, drawn at random, in which the exactly best is among the first three."""
    exact: list[float]
    """Of every view [m^3], [-]."""
    fast: list[float]
    """[m^3], [m^2]"""


class GainBenchmark(_Figures):
    """The gains of many views in the map of a mission."""

    scene: str
    preset: str
    seed: int
    time_s: float
    """Of the mission, when its map was taken."""
    n_gaussians: int
    n_views: int
    coverage: GainFidelity
    quality: GainFidelity


def run_gain_benchmark(
    request: MissionRequest,
    *,
    n_views: int,
    observer: MissionObserver,
    commands: CommandSource,
    progress: Callable[[str], None],
) -> GainBenchmark:
    """Run a mission up to its `max_time_s`, then score views at its candidates' places, with yaws at random.

    Raises as `run_mission` does, and `PlanningError` when the mission weighed no candidate.
    """
    config = resolve_mission_config(request.preset, request.overrides)
    limits = config.limits.model_copy(update={"max_time_s": request.max_time_s or config.limits.max_time_s})
    config = config.model_copy(update={"limits": limits})
    kernels.set_threads(config.threads)
    recorder = _Candidates(observer)
    with tempfile.TemporaryDirectory(prefix="hgs-bench-") as folder:
        parts = build_mission(
            config,
            request.scene,
            request.seed,
            Path(folder) / "keyframes",
            observer=recorder,
            commands=commands,
        )
        parts.mission.run()
        time_s = parts.world.robot.state.timestamp_s
        if not recorder.places_m:
            raise PlanningError(f"no candidate was weighed in the first {time_s:.0f} s: run for longer")
        poses = draw_poses(np.array(recorder.places_m), n_views, np.random.default_rng(request.seed))
        coverage, quality = _compare(parts.mapper.snapshot(), config, poses, progress)
        return GainBenchmark(
            scene=parts.name,
            preset=request.preset,
            seed=request.seed,
            time_s=time_s,
            n_gaussians=parts.mapper.gaussians.size,
            n_views=n_views,
            coverage=coverage,
            quality=quality,
        )


def draw_poses(
    places_m: Float[ndarray, "n 2"], n_views: int, rng: np.random.Generator
) -> Float[ndarray, "n_views 3"]:
    """x, y [m], yaw [rad]: as many different places as there are."""
    chosen = np.concatenate([rng.permutation(len(places_m)) for _ in range(-(-n_views // len(places_m)))])
    yaws = rng.uniform(-np.pi, np.pi, n_views)
    return np.column_stack([places_m[chosen[:n_views]], yaws])


def _compare(
    snapshot: MapSnapshot,
    config: MissionConfig,
    poses: Float[ndarray, "n 3"],
    progress: Callable[[str], None],
) -> tuple[GainFidelity, GainFidelity]:
    """Coverage and quality. The exact score knows no saturation: neither does the fast one here."""
    camera, range_m = config.sensor.camera.intrinsics(), config.sensor.camera.range_m
    gain = config.planner.gain.model_copy(
        update={
            "quality_saturation_m": 0.0,
            "use_coverage": True,
            "use_quality": True,
            "coverage_measure": CoverageMeasure.VOLUME,
        }
    )
    positions = np.column_stack([poses[:, :2], np.full(len(poses), config.sensor.camera.mount_height_m)])
    gains = PanoramaGainEvaluator(gain, camera, range_m).evaluate(snapshot, positions, observed_share=1.0)
    nearest = np.argmin(np.abs(wrap_angle(gains.yaws_rad[None] - poses[:, 2:])), axis=1)
    views = np.arange(len(poses)), nearest
    coverage, quality = [], []
    for i, (x_m, y_m, z_m) in enumerate(positions.tolist()):
        progress(f"exact scores of view {i + 1} of {len(poses)}")
        pose = level_camera_pose(x_m, y_m, z_m, float(gains.yaws_rad[nearest[i]]))
        coverage.append(exact_coverage(snapshot, camera, pose, range_m=range_m))
        quality.append(
            exact_quality(snapshot, camera, pose, prior_information=gain.prior_information, range_m=range_m)
        )
    return (
        fidelity(np.array(coverage), gains.coverage_by_yaw[views]),
        fidelity(np.array(quality), gains.quality_by_yaw[views]),
    )


def fidelity(exact: Float[ndarray, " n"], fast: Float[ndarray, " n"]) -> GainFidelity:
    """How well `fast` ranks what is worth `exact`."""
    rng = np.random.default_rng(0)
    hits = 0
    for _ in range(N_CASES):
        case = rng.choice(len(exact), min(CASE_SIZE, len(exact)), replace=False)
        first = case[np.argsort(-fast[case], kind="stable")[:AMONG_FIRST]]
        hits += bool(np.isin(case[np.argmax(exact[case])], first))
    gaining = exact > NOTHING_BELOW * exact.max()
    return GainFidelity(
        spearman=float(spearmanr(exact, fast)[0]),
        n_gaining=int(np.count_nonzero(gaining)),
        spearman_gaining=float(spearmanr(exact[gaining], fast[gaining])[0]),
        best_among_first=hits / N_CASES,
        exact=exact.tolist(),
        fast=fast.tolist(),
    )


class _Candidates:
    """Passes everything on, and keeps the places that the planner weighed."""

    def __init__(self, observer: MissionObserver) -> None:
        self.places_m: list[tuple[float, float]] = []
        self._observer = observer

    def on_event(self, event: MissionEvent) -> None:
        if isinstance(event, PlanMade):
            self.places_m += [
                (c["x_m"], c["y_m"]) for c in event.candidates if c["status"] != CandidateStatus.UNREACHABLE
            ]
        self._observer.on_event(event)

    def wants_view(self) -> bool:
        return self._observer.wants_view()

    def on_view(self, view: MissionView) -> None:
        self._observer.on_view(view)

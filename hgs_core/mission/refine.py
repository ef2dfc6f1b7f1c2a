"""`refine_run`: a finished run's map, optimised further from the keyframes that the run kept."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hgs_core.errors import ConfigError
from hgs_core.evaluation.report import MissionReport
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.ply import read_ply, write_ply
from hgs_core.mapping.keyframe_archive import KeyframeArchive
from hgs_core.mapping.refinement import Refinement
from hgs_core.mission.config import MissionConfig
from hgs_core.native import kernels

_SEED = 4
_SAVE_EVERY_S = 30.0
_SMOOTHING = 0.98


@dataclass(frozen=True, kw_only=True)
class RefinementProgress:
    """How far a refinement has come."""

    elapsed_s: float
    steps: int
    colour_l1: float
    """Mean absolute colour error over the last fifty keyframes or so, 0..1."""
    depth_l1_m: float
    full_resolution: bool


def refine_run(
    folder: Path,
    config: MissionConfig,
    *,
    time_s: float,
    progress: Callable[[RefinementProgress], None],
    interrupted: Callable[[], bool],
) -> MissionReport:
    """Optimise `map.ply` in `folder` for `time_s` wall seconds, and say so in `report.json`.

    The map is saved every half minute and when `interrupted` ends the work early, each time whole: at any
    moment the folder holds a map, the mission's or a better one. Quality figures of the report that no longer
    hold are removed; an evaluation gives new ones. Raises `ConfigError` for a time that is not positive and
    `MapError` for a folder without map or keyframes.
    """
    if not time_s > 0.0:
        raise ConfigError(f"time_s must be more than 0 seconds, got {time_s}")
    kernels.set_threads(config.threads)
    report = MissionReport.read(folder / "report.json")
    gaussians = read_ply(folder / "map.ply")
    keyframes = KeyframeArchive.open(folder)
    refinement = Refinement(
        gaussians,
        keyframes,
        config.refinement,
        loss=config.mapping.loss,
        rates=config.mapping.rates,
        range_m=config.sensor.camera.range_m,
        rng=np.random.default_rng(_SEED),
    )
    with refinement:
        done = _refine(refinement, gaussians, folder, time_s, progress, interrupted)
    write_ply(gaussians, folder / "map.ply")
    renewed = report.refined(seconds=done.elapsed_s, steps=done.steps)
    renewed.write(folder / "report.json")
    return renewed


def _refine(
    refinement: Refinement,
    gaussians: GaussianMap,
    folder: Path,
    time_s: float,
    progress: Callable[[RefinementProgress], None],
    interrupted: Callable[[], bool],
) -> RefinementProgress:
    began = saved = time.perf_counter()
    done = RefinementProgress(
        elapsed_s=0.0, steps=0, colour_l1=np.nan, depth_l1_m=np.nan, full_resolution=False
    )
    while done.elapsed_s < time_s and not interrupted():
        step = refinement.step(done.elapsed_s / time_s)
        now = time.perf_counter()
        if now - saved >= _SAVE_EVERY_S:
            write_ply(gaussians, folder / "map.ply")
            saved = time.perf_counter()
        done = RefinementProgress(
            elapsed_s=time.perf_counter() - began,
            steps=done.steps + 1,
            colour_l1=_smoothed(done.colour_l1, step.colour_l1),
            depth_l1_m=_smoothed(done.depth_l1_m, step.depth_l1_m),
            full_resolution=step.full_resolution,
        )
        progress(done)
    return done


def _smoothed(mean: float, value: float) -> float:
    return value if np.isnan(mean) else _SMOOTHING * mean + (1.0 - _SMOOTHING) * value

"""`hgs bench mission`: how long planning and mapping take along a whole mission, and how that grows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from pydantic import BaseModel, ConfigDict

import hgs_core.native.kernels as kernels
from hgs_core.benchmark.kernels import processor_name
from hgs_core.mission.commands import CommandSource
from hgs_core.mission.events import MissionEvent, MissionObserver, MissionView, PlanMade, Telemetry
from hgs_core.mission.request import MissionRequest
from hgs_core.mission.run import run_mission

PARTS: Final = 4
"""The mission is cut into so many equal parts, to show growth."""


class _Figures(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class Spread(_Figures):
    """Of many times [ms]."""

    median: float | None
    p95: float | None

    @staticmethod
    def of(seconds: Sequence[float]) -> Spread:
        if not seconds:
            return Spread(median=None, p95=None)
        return Spread(median=1e3 * float(np.median(seconds)), p95=1e3 * float(np.percentile(seconds, 95)))


class MissionPart(_Figures):
    """One part of the mission, by its frames."""

    until_s: float
    """Mission time at its end."""
    n_gaussians: int
    """At its end."""
    observed_volume_m3: float
    planning_ms: Spread
    global_ms: Spread
    mapping_ms: Spread


class MissionBenchmark(_Figures):
    """What one mission's planning cycles and frames took."""

    cpu: str
    threads: int
    variant: str
    scene: str
    preset: str
    seed: int
    stop_reason: str
    cycles: int
    frames: int
    n_gaussians: int
    planning_ms: Spread
    """T_P = T_VE + T_LP + T_GP (HGS-Planner section IV-B)."""
    viewpoint_evaluation_ms: Spread
    """T_VE"""
    local_ms: Spread
    """T_LP"""
    global_ms: Spread
    """T_GP, with the survey of the maps that both levels read."""
    mapping_ms: Spread
    """Of a frame."""
    parts: list[MissionPart]


def run_mission_benchmark(
    request: MissionRequest, *, observer: MissionObserver, commands: CommandSource
) -> MissionBenchmark:
    """Run a mission without its evaluation, and time it. Raises as `run_mission` does."""
    recorder = _Recorder(observer)
    request = replace(request, overrides={**request.overrides, "evaluate": "false"})
    report = run_mission(request, observer=recorder, commands=commands)
    assert report is not None, "nobody suspends a mission that is timed"
    plans, frames = recorder.plans, recorder.frames
    return MissionBenchmark(
        cpu=processor_name(),
        threads=kernels.threads(),
        variant=kernels.variant(),
        scene=report.scene,
        preset=request.preset,
        seed=request.seed,
        stop_reason=report.stop_reason,
        cycles=len(plans),
        frames=len(frames),
        n_gaussians=report.n_gaussians,
        planning_ms=Spread.of([plan.planning_s for plan in plans]),
        viewpoint_evaluation_ms=Spread.of([plan.viewpoint_evaluation_s for plan in plans]),
        local_ms=Spread.of([plan.local_s for plan in plans]),
        global_ms=Spread.of([plan.global_s for plan in plans]),
        mapping_ms=Spread.of([frame.mapping_s for frame in frames]),
        parts=_parts(plans, frames),
    )


def _parts(plans: list[PlanMade], frames: list[Telemetry]) -> list[MissionPart]:
    parts = []
    since_s = -np.inf
    for of_part in np.array_split(np.arange(len(frames)), PARTS):
        if not len(of_part):
            continue
        last = frames[of_part[-1]]
        of_time = [plan for plan in plans if since_s < plan.time_s <= last.time_s]
        parts.append(
            MissionPart(
                until_s=last.time_s,
                n_gaussians=last.n_gaussians,
                observed_volume_m3=last.observed_volume_m3,
                planning_ms=Spread.of([plan.planning_s for plan in of_time]),
                global_ms=Spread.of([plan.global_s for plan in of_time]),
                mapping_ms=Spread.of([frames[k].mapping_s for k in of_part]),
            )
        )
        since_s = last.time_s
    return parts


class _Recorder:
    """Passes everything on, and keeps what is timed."""

    def __init__(self, observer: MissionObserver) -> None:
        self.plans: list[PlanMade] = []
        self.frames: list[Telemetry] = []
        self._observer = observer

    def on_event(self, event: MissionEvent) -> None:
        if isinstance(event, PlanMade):
            self.plans.append(event)
        elif isinstance(event, Telemetry):
            self.frames.append(event)
        self._observer.on_event(event)

    def wants_view(self) -> bool:
        return self._observer.wants_view()

    def on_view(self, view: MissionView) -> None:
        self._observer.on_view(view)

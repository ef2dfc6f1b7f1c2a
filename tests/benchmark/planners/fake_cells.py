"""Missions that take no time: their figures follow from planner and seed by formulas that tests repeat."""

import json
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from hgs_core.benchmark.planners.cell import CellKey, CellResult
from hgs_core.benchmark.planners.engine import Engine
from hgs_core.benchmark.planners.estimate import GridProgress
from hgs_core.benchmark.planners.fingerprint import Fingerprint
from hgs_core.benchmark.planners.grid import GridRequest, PlannedCell, PlannedScene
from hgs_core.benchmark.planners.run import run_grid
from hgs_core.benchmark.planners.task import CellAnswer, CellTask
from hgs_core.errors import SceneError
from hgs_core.evaluation.report import MissionReport
from hgs_core.evaluation.report_parts import PlanningSeconds
from hgs_core.evaluation.trajectory import Trajectory, write_trajectory
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.ply import write_ply
from hgs_core.geometry.camera import level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.mission.commands import Command, CommandSource
from hgs_core.mission.events import MissionObserver
from hgs_core.mission.folder import RunFolder
from hgs_core.mission.request import MissionRequest
from hgs_core.mission.versions import software_versions
from hgs_core.native import kernels

RUNNER = "tests.benchmark.planners.fake_cells:run"

FAILING = 13
"""Seeds of missions that cannot begin, ..."""
DYING = 17
"""... whose process dies without a word, ..."""
HANGING = 19
"""... that never end, ..."""
STUCK = 23
"""... and that end with `stuck`."""

SPEED = {"paper": 1.0, "best": 0.9, "coverage": 1.2, "quality": 1.5, "both": 1.1, "nearest-frontier": 1.4}


def run(request: MissionRequest, *, observer: MissionObserver, commands: CommandSource) -> None:
    """With the signature of `run_mission`."""
    folder = RunFolder.new(request.out)
    if request.seed == FAILING:
        raise SceneError("no floor & nowhere to stand: 50% of {x_1}")
    if request.seed == DYING:
        os._exit(9)
    if request.seed == HANGING:
        time.sleep(600)
    yaws = np.linspace(0.0, 3.0, 5)
    poses = [level_camera_pose(0.5 * yaw, 0.2 * yaw, 1.0, yaw) for yaw in yaws]
    batch = SE3(
        rotation=np.stack([pose.rotation for pose in poses]),
        translation=np.stack([pose.translation for pose in poses]),
    )
    write_trajectory(Trajectory(timestamps_s=np.arange(5.0), poses=batch), folder.partial / "trajectory.txt")
    gaussians = GaussianMap()
    gaussians.append(floor(), anchor_keyframe=0)
    write_ply(gaussians, folder.partial / "map.ply")
    content = report(request.scene, str(request.planner), request.seed)
    (folder.partial / "report.json").write_text(json.dumps(content))
    folder.complete()


def floor() -> np.ndarray:
    """A patch of blue floor: centre, colour, radius, opacity."""
    x, y = np.meshgrid(np.linspace(-2, 3, 40), np.linspace(-2, 3, 40))
    parameters = np.zeros((x.size, 8), dtype=np.float32)
    parameters[:, 0], parameters[:, 1] = x.ravel(), y.ravel()
    parameters[:, 3:6] = (0.3, 0.4, 0.7)
    parameters[:, 6], parameters[:, 7] = np.log(0.08), 4.0
    return parameters


def path_m(planner: str, seed: int) -> float:
    return 10.0 * SPEED.get(planner, 1.3) + seed


def report(scene: str, planner: str, seed: int) -> dict:
    """10 m times the planner's factor, and one more for every seed; completion grows straight to 0.96."""
    way_m = path_m(planner, seed)
    content = MissionReport(
        scene=scene,
        seed=seed,
        preset="robust",
        planner=planner,
        stop_reason="stuck" if seed == STUCK else "complete",
        frames=10,
        keyframes=2,
        n_gaussians=1600,
        path_length_m=way_m,
        sim_time_s=2 * way_m,
        wall_s=1.0,
        accuracy_cm=0.5 + seed / 10,
        completion_cm=2.0,
        completion_ratio=0.7,
        completion_cm_observable=1.5,
        completion_ratio_observable=0.96,
        planning_s=PlanningSeconds(median=0.1, viewpoint_evaluation=0.05),
        collisions=seed % 2,
        versions={"hgs": "0"},
        kernel_variant="test",
        threads=1,
    ).model_dump(mode="json", by_alias=True)
    samples = np.linspace(0.0, 1.0, 25)
    content["completion_curve"] = [
        {"path_m": way_m * s, "time_s": 2 * way_m * s, "ratio": 0.96 * s} for s in samples
    ]
    content["path_m_at_90"] = way_m * 0.90 / 0.96
    content["path_m_at_95"] = None if seed == STUCK else way_m * 0.95 / 0.96
    return content


class FakeEngine:
    """Runs cells in this process, when they are started."""

    name = "fake"

    def __init__(self, slots: int = 1) -> None:
        self.slots = slots
        self.started: list[str] = []
        self.closed = False
        self._ended: list[tuple[CellTask, CellAnswer]] = []

    def start(self, task: CellTask) -> None:
        self.started.append(task.name)
        self._ended.append((task, self._run(task)))

    def ended(self, timeout_s: float) -> list[tuple[CellTask, CellAnswer]]:
        ended, self._ended = self._ended, []
        return ended

    def close(self) -> None:
        self.closed = True

    def _run(self, task: CellTask) -> CellAnswer:
        request = MissionRequest(
            scene=task.scene,
            preset=task.preset,
            planner=task.planner,
            seed=task.seed,
            out=Path(task.out),
            max_time_s=None,
            overrides=task.overrides,
        )
        try:
            run(request, observer=None, commands=None)
        except SceneError as error:
            return CellAnswer(failure=f"SceneError: {error}", processor="a test")
        return CellAnswer(processor="a test")


class Watcher:
    """A `GridObserver` and `CommandSource` that says STOP after so many cells."""

    def __init__(self, stop_after: int | None = None) -> None:
        self.ended: list[CellResult] = []
        self.left_s: list[float | None] = []
        self._stop_after = stop_after

    def cell_ended(self, result: CellResult, progress: GridProgress) -> None:
        self.ended.append(result)
        self.left_s.append(progress.left_s())

    def waiting(self, progress: GridProgress) -> None:
        """Nobody looks."""

    def poll(self) -> Command | None:
        return Command.STOP if self._stop_after is not None and len(self.ended) >= self._stop_after else None


def asked(
    out: Path,
    planners: Sequence[str] = ("paper", "nearest-frontier"),
    seeds: Sequence[int] = (0, 1),
    scenes: Sequence[str] = ("house",),
    **overrides: str,
) -> tuple[GridRequest, list[PlannedCell]]:
    """A request and its cells, without a scene being opened; `overrides` become settings."""
    request = GridRequest(
        scenes=scenes, planners=planners, seeds=seeds, preset="robust", overrides=overrides, out=out
    )
    fingerprint = Fingerprint(
        scene="a digest",
        settings={"threads": 1, "planner": {"gain_threshold": 0.5, **overrides}},
        versions=software_versions(),
        kernel_variant=kernels.variant(),
    )
    planned = {
        name: PlannedScene(source=name, name=name, digest="a digest", lower_m=(-3, -3), upper_m=(4, 4))
        for name in scenes
    }
    cells = [
        PlannedCell(
            key=CellKey(planner=planner, scene=scene, seed=seed),
            scene=planned[scene],
            threads=1,
            fingerprint=fingerprint,
        )
        for scene in scenes
        for seed in seeds
        for planner in planners
    ]
    return request, cells


def run_fake_grid(
    request: GridRequest,
    cells: Sequence[PlannedCell],
    engine: Engine | None = None,
    *,
    watcher: Watcher | None = None,
    redo: bool = False,
    write_outputs: Callable[[], object] = lambda: None,
) -> Watcher:
    """Run a grid of missions that take no time; returns what was seen of it."""
    watcher = watcher or Watcher()
    stopped = run_grid(
        request,
        cells,
        engine or FakeEngine(),
        observer=watcher,
        commands=watcher,
        write_outputs=write_outputs,
        redo=redo,
        runner=RUNNER,
    )
    assert stopped == (watcher.poll() is Command.STOP)
    return watcher

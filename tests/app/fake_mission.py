"""Mission runners without a simulator: quick, deterministic, and some that misbehave.

The real child process, transport, service and viewer run around them. `runner(NAME)` is what
`create_app(settings, runner=...)` takes.
"""

from __future__ import annotations

import json
import os
import shutil
import time
from pathlib import Path
from typing import Any

import numpy as np

from hgs_core.errors import SceneError
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.mission.commands import Command, Decide, Direct
from hgs_core.mission.events import (
    ApprovalChanged,
    ApprovalState,
    DirectivesTaken,
    MissionEnded,
    MissionPhase,
    Notice,
    PhaseChanged,
    Resumed,
    StopReason,
)
from hgs_core.mission.folder import EventLog
from hgs_core.mission.telling import plan_made
from hgs_core.planning.directives import Directives
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap
from tests.app.fake_world import FRAME_INTERVAL_S, plan_from, robot_at, room, telemetry_of, view_of


def runner(name: str) -> str:
    """The dotted name of one of the runners below."""
    assert callable(globals()[name])
    return f"{__name__}:{name}"


def run_long(request: Any, *, observer: Any, commands: Any) -> None:
    """Runs until it is stopped, as far as a test is concerned."""
    _drive(request, observer, commands, frames=3000)


def run_slowly(request: Any, *, observer: Any, commands: Any) -> None:
    """At the pace of a real mission."""
    _drive(request, observer, commands, frames=600, frame_s=0.15)


def run_for_hours(request: Any, *, observer: Any, commands: Any) -> None:
    """Two hours of mission time, in ten minutes or more."""
    _drive(request, observer, commands, frames=round(7200 / FRAME_INTERVAL_S))


def run_short(request: Any, *, observer: Any, commands: Any) -> None:
    """Ends by itself within a second."""
    _drive(request, observer, commands, frames=20)


def run_failing(request: Any, *, observer: Any, commands: Any) -> None:
    """Raises an error of the project after a few frames."""
    _drive(request, observer, commands, frames=20, raise_at=5)


def run_vanishing(request: Any, *, observer: Any, commands: Any) -> None:
    """Its process ends without a word."""
    _drive(request, observer, commands, frames=20, exit_at=5)


def run_deaf(request: Any, *, observer: Any, commands: Any) -> None:
    """Never reads a command."""
    _drive(request, observer, commands, frames=3000, deaf=True)


def _drive(
    request: Any,
    observer: Any,
    commands: Any,
    *,
    frames: int,
    frame_s: float = 0.02,
    raise_at: int = -1,
    exit_at: int = -1,
    deaf: bool = False,
) -> None:
    """Along a circle through one furnished room, obeying commands like the real loop. Every tenth frame is
    saved, and a mission that was begun before goes on from there."""
    saved = Path(f"{request.out}.partial") / "saved.json"
    frame = json.loads(saved.read_text()) if request.resume and saved.is_file() else 0
    saved.parent.mkdir(parents=True, exist_ok=True)
    observer = EventLog(saved.with_name("events.jsonl"), observer)
    if request.resume and saved.is_file():
        observer.go_on_from(frame * FRAME_INTERVAL_S)
        observer.on_event(Resumed(time_s=frame * FRAME_INTERVAL_S, reason="going on from what was saved"))
    saved.write_text(json.dumps(frame))
    observer.on_event(PhaseChanged(time_s=0.0, phase=MissionPhase.PREPARING, reason="opening the fake room"))
    rng = np.random.default_rng(request.seed)
    world = room(rng)
    gaussians = GaussianMap()
    voxels = VoxelMap(VoxelConfig())
    trajectory: list[np.ndarray] = []
    observer.on_event(PhaseChanged(time_s=0.0, phase=MissionPhase.RUNNING, reason="the first frame is in"))
    stop_reason, message = StopReason.COMPLETE, "nothing worth seeing is left"
    began = time.perf_counter()
    paused = False
    asked = _Asked(request, observer)
    while frame < frames:
        command = None if deaf else asked.newest(commands)
        time_s = frame * FRAME_INTERVAL_S
        if command is Command.STOP:
            stop_reason, message = StopReason.INTERRUPTED, "stopped by the operator"
            break
        if frame % 10 == 0 or command is Command.SUSPEND:
            saved.write_text(json.dumps(frame))
        if command is Command.SUSPEND:
            observer.on_event(PhaseChanged(time_s=time_s, phase=MissionPhase.SUSPENDED, reason="saved"))
            return
        if command is Command.PAUSE and not paused:
            paused = True
            observer.on_event(
                PhaseChanged(time_s=time_s, phase=MissionPhase.PAUSED, reason="paused by the operator")
            )
        elif command is Command.RESUME and paused:
            paused = False
            observer.on_event(
                PhaseChanged(time_s=time_s, phase=MissionPhase.RUNNING, reason="resumed by the operator")
            )
        if paused or asked.waits(frame, time_s):
            time.sleep(0.01)
            continue
        if frame == raise_at:
            raise SceneError("the fake room has no free floor")
        if frame == exit_at:
            os._exit(7)
        share = (frame + 1) / frames
        grown = round(len(world) * share) - gaussians.size
        if grown > 0:
            gaussians.append(world[gaussians.size : gaussians.size + grown], anchor_keyframe=frame)
        robot = robot_at(share, frame)
        trajectory.append(np.array([robot.x_m, robot.y_m, 1.0], np.float32))
        plan = plan_from(robot, share, np.random.default_rng([request.seed, frame]))
        observer.on_event(telemetry_of(frame, share, robot, gaussians.size, began))
        if frame % 5 == 0:
            observer.on_event(plan_made(plan, "five frames on", sequence=frame // 5 + 1, time_s=time_s))
        if frame == 3:
            observer.on_event(Notice(time_s=time_s, level="warning", message="a fake chair is in the way"))
        if observer.wants_view():
            observer.on_view(view_of(gaussians, voxels, robot, plan, trajectory, frame))
        time.sleep(frame_s)
        frame += 1
    time_s = frame * FRAME_INTERVAL_S
    observer.on_event(PhaseChanged(time_s=time_s, phase=MissionPhase.EVALUATING, reason="writing results"))
    _write(request, stop_reason, frame)
    observer.on_event(MissionEnded(time_s=time_s, stop_reason=stop_reason, message=message))
    observer.on_event(PhaseChanged(time_s=time_s, phase=MissionPhase.ENDED, reason=message))


class _Asked:
    """What the operator asks of the fake mission: as the real loop, it tells what it has taken."""

    def __init__(self, request: Any, observer: Any) -> None:
        self._observer = observer
        self._approves = False
        self._decided = 0
        self._waiting = False
        text = request.overrides.get("directives")
        if text is not None:
            self._take(Directives.model_validate_json(text), 0.0)

    def newest(self, commands: Any) -> Command | None:
        """Polls until nothing is left; directives and decisions are taken at once."""
        newest = None
        while (order := commands.poll()) is not None:
            if isinstance(order, Direct):
                self._take(order.directives, 0.0)
            elif isinstance(order, Decide):
                state = ApprovalState.APPROVED if order.approved else ApprovalState.REJECTED
                self._tell(state, order.plan_sequence, 0.0)
                self._decided, self._waiting = order.plan_sequence, False
            else:
                newest = order
        return newest

    def waits(self, frame: int, time_s: float) -> bool:
        """Whether the newest plan waits for the operator's word."""
        sequence = (frame - 1) // 5 + 1
        if not self._approves or frame == 0 or frame % 5 != 1 or self._decided >= sequence:
            return False
        if not self._waiting:
            self._waiting = True
            self._tell(ApprovalState.WAITING, sequence, time_s)
            reason = f"waits for the operator to approve plan {sequence}"
            self._observer.on_event(
                PhaseChanged(time_s=time_s, phase=MissionPhase.AWAITING_APPROVAL, reason=reason)
            )
        return True

    def _take(self, directives: Directives, time_s: float) -> None:
        self._approves = directives.approve_views
        told = directives.model_dump(mode="json")
        self._observer.on_event(DirectivesTaken(time_s=time_s, directives=told))

    def _tell(self, state: ApprovalState, sequence: int, time_s: float) -> None:
        self._observer.on_event(
            ApprovalChanged(
                time_s=time_s,
                state=state,
                plan_sequence=sequence,
                view={"x_m": 1.0, "y_m": 2.0, "yaw_rad": 0.5},
                reason="a test",
            )
        )


def _write(request: Any, stop_reason: StopReason, frames: int) -> None:
    out = Path(request.out)
    shutil.rmtree(f"{out}.partial")
    out.mkdir(parents=True)
    report = {
        "scene": request.scene,
        "seed": request.seed,
        "clock": request.clock,
        **({"extends": str(request.extends)} if request.extends else {}),
        "stop_reason": str(stop_reason),
        "frames": frames,
    }
    (out / "report.json").write_text(json.dumps(report), encoding="utf-8")
    (out / "trajectory.txt").write_text("# timestamp tx ty tz qx qy qz qw\n", encoding="utf-8")

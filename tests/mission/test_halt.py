"""STOP lets the robot stand at once, whatever the loop is busy with, and nothing moves it afterwards."""

import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hgs_core.mission.clock import LockstepClock
from hgs_core.mission.commands import Command, PromptCommands
from hgs_core.mission.config import MissionLimits
from hgs_core.mission.events import Halted, MissionEvent, StopReason
from hgs_core.mission.folder import EventLog
from hgs_core.mission.mission import Mission
from hgs_core.planning.config import HierarchicalConfig
from hgs_core.planning.directives import Directives
from hgs_core.planning.navigator import Navigator
from hgs_core.planning.plan import NothingLeft, Plan
from hgs_core.robot.differential import Differential, DifferentialConfig
from tests.mission.passing_time import PassingTime
from tests.mission.test_real_time import (
    INTERVAL_S,
    Heard,
    RobotAtViews,
    SlowMapper,
    SlowPlanner,
    SlowSensors,
    TurningRobot,
)

PATIENCE_S = 60.0


class Operator:
    """Says STOP, to the thread that listens for it first and to the loop when that asks."""

    def __init__(self) -> None:
        self.react: Callable[[], None] | None = None
        self.told = False

    def on_stop(self, react: Callable[[], None]) -> None:
        self.react = react

    def poll(self) -> Command | None:
        told, self.told = self.told, False
        return Command.STOP if told else None


class Busy:
    """Something that the loop is in the middle of."""

    def __init__(self) -> None:
        self.entered, self.leave = threading.Event(), threading.Event()

    def be(self) -> None:
        if not self.leave.is_set():
            self.entered.set()
            assert self.leave.wait(PATIENCE_S)


class BusyMapper(SlowMapper):
    busy: Busy | None = None

    def integrate(self, frame, *, may_thin=False):
        if self.busy is not None and frame.sequence > 2:
            self.busy.be()
        return super().integrate(frame, may_thin=may_thin)


class BusyPlanner(SlowPlanner):
    busy: Busy | None = None

    def plan(self, snapshot, state, rng) -> Plan | NothingLeft:
        if self.busy is not None:
            self.busy.be()
        return super().plan(snapshot, state, rng)


class Everything(Heard):
    def __init__(self) -> None:
        super().__init__()
        self.events: list[MissionEvent] = []

    def on_event(self, event: MissionEvent) -> None:
        self.events.append(event)


@pytest.mark.parametrize("part", ["mapper", "planner"])
def test_the_robot_stands_before_the_loop_has_come_to_stop_and_never_moves_again(
    part: str, tmp_path: Path
) -> None:
    time, busy, operator, heard = PassingTime(), Busy(), Operator(), Everything()
    assert isinstance(operator, PromptCommands)
    robot = TurningRobot(1.0) if part == "mapper" else RobotAtViews(1.0)
    sensors = SlowSensors(robot, time, 0.0)
    mapper = BusyMapper(tmp_path / "keyframes", time, integration_s=0.0, step_s=0.0)
    planner = BusyPlanner(time, 0.0)
    (mapper if part == "mapper" else planner).busy = busy
    mission = Mission(
        robot=robot,
        vehicle=Differential(DifferentialConfig()),
        sensor=sensors,
        scanner=sensors,
        mapper=mapper,
        planner=planner,
        planner_rng=np.random.default_rng(0),
        limits=MissionLimits(max_time_s=60.0, stuck_after_plans=1000),
        clock=LockstepClock(INTERVAL_S),
        observer=EventLog(tmp_path / "events.jsonl", heard),
        commands=operator,
        navigator=Navigator(HierarchicalConfig(), DifferentialConfig()),
        directives=Directives(),
    )
    loop = threading.Thread(target=mission.run, daemon=True)
    loop.start()
    assert busy.entered.wait(PATIENCE_S)
    assert operator.react is not None
    operator.react()
    assert not robot._moves
    yaw_rad = robot.state.yaw_rad
    assert [type(event) for event in heard.events if isinstance(event, Halted)] == [Halted]
    assert mission.record.stop_reason is None  # the loop knows nothing yet
    busy.leave.set()
    operator.told = True
    loop.join(PATIENCE_S)
    assert not loop.is_alive()
    assert mission.record.stop_reason is StopReason.INTERRUPTED
    assert not robot._moves
    assert robot.state.yaw_rad == yaw_rad
    assert '"kind":"halted"' in (tmp_path / "events.jsonl").read_text()

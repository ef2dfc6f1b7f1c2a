"""Missions whose robot is another program: by the wall clock, so short ones."""

import queue
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from hgs_core.errors import ConfigError
from hgs_core.evaluation.report import MissionReport
from hgs_core.live.messages import PROTOCOL, Answer, Bye, CameraFacts, End, Hello, encoded, to_robot
from hgs_core.mission.commands import Command
from hgs_core.mission.events import MissionEvent, MissionView, Notice, PhaseChanged, PlanMade
from hgs_core.mission.finished_run import FinishedRun
from hgs_core.mission.request import MissionRequest
from hgs_core.mission.run import NoCommands, run_mission
from tests.live.far_robot import FarRobot, QueueLink, far_config, frame_message
from tests.mission.small_room import write_small_room

SETTINGS = {"sensor": "rgbd_5m_tiny", "threads": "1", "mesh.enabled": "false", "live.dead_man_s": "0.5"}
PATIENCE_S = 60.0


class Watched:
    """Keeps the events; `until` waits for one."""

    def __init__(self) -> None:
        self.events: list[MissionEvent] = []
        self._news: queue.Queue[MissionEvent] = queue.Queue()

    def on_event(self, event: MissionEvent) -> None:
        self.events.append(event)
        self._news.put(event)

    def wants_view(self) -> bool:
        return False

    def on_view(self, view: MissionView) -> None:
        raise AssertionError("nobody asked")

    def until(self, is_it) -> MissionEvent:
        deadline = time.monotonic() + PATIENCE_S
        while not is_it(event := self._news.get(timeout=max(0.1, deadline - time.monotonic()))):
            pass
        return event

    def phases(self) -> list[tuple[str, str]]:
        return [(str(e.phase), e.reason) for e in self.events if isinstance(e, PhaseChanged)]


class Orders:
    """A `CommandSource` in the test's hand."""

    def __init__(self) -> None:
        self.given: queue.Queue[Command] = queue.Queue()

    def poll(self) -> Command | None:
        return None if self.given.empty() else self.given.get()


def request(out: Path, **changes) -> MissionRequest:
    facts = {"scene": "live", "preset": "quick", "seed": 0, "max_time_s": None, "overrides": SETTINGS}
    return MissionRequest(out=out, **{**facts, **changes})


def begun(wish: MissionRequest, link: QueueLink, orders) -> tuple[Watched, threading.Thread, list]:
    watched, ends = Watched(), []

    def run() -> None:
        ends.append(run_mission(wish, observer=watched, commands=orders, link=link))

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return watched, thread, ends


def is_phase(phase: str):
    return lambda event: isinstance(event, PhaseChanged) and event.phase == phase


def test_a_robot_explores_falls_silent_and_goes_on(tmp_path: Path) -> None:
    link, orders = QueueLink(), Orders()
    robot = FarRobot(far_config(), write_small_room(tmp_path), link.from_robot.put)
    threading.Thread(target=lambda: hear_all(robot, link), daemon=True).start()
    robot.begin()
    watched, mission, ends = begun(request(tmp_path / "run"), link, orders)

    watched.until(lambda event: isinstance(event, PlanMade))
    robot.mute.set()
    watched.until(is_phase("paused"))
    robot.mute.clear()
    watched.until(is_phase("running"))
    watched.until(lambda event: isinstance(event, PlanMade))

    orders.given.put(Command.PAUSE)
    watched.until(is_phase("paused"))
    wait_until(lambda: robot.world.robot.arrived)
    stood = robot.world.robot.state
    orders.given.put(Command.RESUME)
    watched.until(is_phase("running"))
    robot.refusing.set()
    watched.until(lambda event: isinstance(event, Notice) and "not now" in event.message)
    robot.refusing.clear()
    watched.until(lambda event: isinstance(event, PlanMade))
    wait_until(lambda: robot.world.robot.state.path_length_m > stood.path_length_m)
    orders.given.put(Command.STOP)
    mission.join(PATIENCE_S)

    (report,) = ends
    assert (report.stop_reason, report.scene, report.clock) == ("interrupted", "live: far robot", "real")
    assert report.collisions == 0
    assert report.completion_ratio is None
    assert report.path_length_m == pytest.approx(robot.world.robot.state.path_length_m, abs=0.05)
    assert MissionReport.read(tmp_path / "run" / "report.json") == report
    assert {"map.ply", "trajectory.txt", "report.html"} <= {p.name for p in (tmp_path / "run").iterdir()}
    assert any("no word from the robot" in reason for _, reason in watched.phases())
    wait_until(lambda: robot.ended is not None)
    assert robot.world.robot.arrived
    assert set(robot.fates) <= {"taken", "dropped"}
    assert robot.fates.count("taken") == report.frames
    config = FinishedRun.open(tmp_path / "run").config
    assert config.sensor.camera.intrinsics() == far_config().sensor.camera.intrinsics()


def test_a_stream_that_nobody_drives_is_mapped_to_its_end(tmp_path: Path) -> None:
    link = QueueLink()
    world = FarRobot(far_config(), write_small_room(tmp_path), link.from_robot.put).world
    camera = far_config().sensor.camera
    facts = camera.intrinsics()
    hello = Hello(
        protocol=PROTOCOL,
        name="a recording",
        camera=CameraFacts(
            **{name: getattr(facts, name) for name in ("width", "height", "fx", "fy", "cx", "cy")},
            range_m=camera.range_m,
            frame_interval_s=0.1,
        ),
        robot=None,
    )
    watched, mission, ends = begun(request(tmp_path / "run"), link, NoCommands())
    link.from_robot.put(encoded(hello))
    for number in range(4):
        sent = frame_message(world.camera.capture(), None, sequence=number, time_s=float(number))
        link.from_robot.put(encoded(sent))
        while not isinstance(answer := to_robot(link.to_robot.get(timeout=PATIENCE_S)), Answer):
            pass
        assert (answer.sequence, answer.fate) == (number, "taken")
    link.from_robot.put(encoded(Bye(reason="the recording is over")))
    mission.join(PATIENCE_S)
    (report,) = ends
    assert (report.stop_reason, report.stop_message) == ("stream_ended", "the recording is over")
    assert report.frames == 4
    assert report.n_gaussians > 1000
    assert not any(isinstance(event, PlanMade) for event in watched.events)
    while not isinstance(to_robot(link.to_robot.get(timeout=PATIENCE_S)), End):
        pass
    assert np.isfinite(report.path_length_m)


def test_without_a_robot_there_is_nothing_to_do(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="hgs serve"):
        run_mission(request(tmp_path / "run"), observer=Watched(), commands=NoCommands())
    wish = request(tmp_path / "run", scene="house")
    with pytest.raises(ConfigError, match="live"):
        run_mission(wish, observer=Watched(), commands=NoCommands(), link=QueueLink())
    assert not list(tmp_path.iterdir())


def hear_all(robot: FarRobot, link: QueueLink) -> None:
    while True:
        robot.hear(link.to_robot.get())


def wait_until(so) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not so():
        assert time.monotonic() < deadline
        time.sleep(0.02)

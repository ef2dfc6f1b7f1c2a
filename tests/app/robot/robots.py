"""Robots for the tests, on a thread of their own."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache

import numpy as np

from app.robot.client import RobotClient
from app.robot.clock import RobotClock
from app.robot.link_faults import FrameFaults, LinkFaults
from app.robot.live_robot import LiveRobot
from app.robot.onboard import Onboard
from app.robot.outcome import MissionWord, Outcome
from hgs_core.config.presets import load_preset
from hgs_core.robot.vehicle import robot_config
from hgs_core.scene.free_floor import StartPose
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.scene import Scene
from hgs_core.sensing.depth_camera import DepthCameraConfig
from hgs_core.sensing.scanner import ScannerConfig
from hgs_core.simulation.driven_world import BodyFaults, DrivenWorld
from tests.scene.worlds import room, with_boxes

CAMERA = DepthCameraConfig(width=60, height=34, focal_px=30.0, frame_interval_s=0.1)
SCANNER = ScannerConfig(n_rays=36)


@cache
def scene(*, blocked: bool = False) -> Scene:
    """A room of 6 x 4 m with the robot in its middle, heading along +x; a box 1 m ahead where `blocked`."""
    mesh = with_boxes(((1.0, -0.5, 0.0), (1.5, 0.5, 0.8))) if blocked else room()
    return Scene(
        name="room",
        mesh=mesh,
        caster=RayCaster(mesh),
        bounds=mesh.bounds(),
        start=StartPose(x_m=0.0, y_m=0.0, yaw_rad=0.0),
        notices=(),
    )


def world(*, drive: str = "wheeled", faults: BodyFaults = BodyFaults(), blocked: bool = False, seed: int = 0):
    return DrivenWorld.of(
        scene(blocked=blocked),
        robot=robot_config(load_preset("robot", drive)),
        camera=CAMERA,
        scanner=SCANNER,
        faults=faults,
        seeds=np.random.SeedSequence(seed),
    )


def live_robot(
    driven: DrivenWorld, clock: RobotClock, said: list[str], *, drive: str = "wheeled"
) -> LiveRobot:
    bounds = driven.scene.bounds
    return LiveRobot(
        driven,
        name="a robot",
        robot=robot_config(load_preset("robot", drive)),
        camera=CAMERA,
        scanner=SCANNER,
        region_m=[bounds.lower_m.tolist(), bounds.upper_m.tolist()],
        depth_format="png",
        clock=clock,
        say=said.append,
    )


class Running:
    """A client that runs in a thread."""

    def __init__(self, client: RobotClient, onboard: Onboard, said: list[str]) -> None:
        self.client, self.onboard, self.said = client, onboard, said
        self.outcome: Outcome | None = None
        self.error: BaseException | None = None
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self.outcome = self._loop.run_until_complete(self.client.run())
        except Exception as error:
            self.error = error

    def interrupt(self) -> None:
        self._loop.call_soon_threadsafe(self.client.interrupt)

    def join(self) -> Outcome | None:
        self._thread.join(30.0)
        assert not self._thread.is_alive()
        if self.error is not None:
            raise self.error
        return self.outcome


@contextmanager
def running(
    url: str,
    onboard: Onboard,
    said: list[str],
    *,
    clock: RobotClock,
    faults: LinkFaults = LinkFaults(),
    give_up_after_s: float = 20.0,
    word: MissionWord = MissionWord(),
) -> Iterator[Running]:
    robot = Running(
        RobotClient(
            url,
            onboard,
            token=None,
            clock=clock,
            faults=faults,
            frame_faults=FrameFaults(faults, np.random.default_rng(7)),
            give_up_after_s=give_up_after_s,
            mission_word=lambda: word,
            say=said.append,
        ),
        onboard,
        said,
    )
    try:
        yield robot
    finally:
        if robot.outcome is None and robot.error is None:
            robot.interrupt()
        robot.join()


def in_a_thread(call, *arguments):
    """What `call` returns or raises: a browser test of the same process leaves an event loop in this one."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(call, *arguments).result()

"""`LiveRobot`: a driven robot on board: body, camera, and the desk that its commands go over."""

from __future__ import annotations

import threading
from collections.abc import Callable

from app.robot.camera import CameraLoop, TakenFrame
from app.robot.clock import RobotClock
from app.robot.commands import CommandDesk
from app.robot.control import ControlLoop
from app.robot.dead_man import DeadMan
from app.robot.onboard import Link
from app.robot.telling import report_of
from hgs_core.live.messages import (
    PROTOCOL,
    Ack,
    CameraFacts,
    FollowPath,
    Hello,
    LimitSpeed,
    Report,
    Stop,
    Welcome,
)
from hgs_core.robot.robot import RobotConfig
from hgs_core.sensing.depth_camera import DepthCameraConfig
from hgs_core.sensing.scanner import ScannerConfig
from hgs_core.simulation.driven_world import DrivenWorld


class LiveRobot:
    """Implements `Onboard`."""

    def __init__(
        self,
        world: DrivenWorld,
        *,
        name: str,
        robot: RobotConfig,
        camera: DepthCameraConfig,
        scanner: ScannerConfig,
        region_m: list[list[float]],
        depth_format: str,
        clock: RobotClock,
        say: Callable[[str], None],
    ) -> None:
        self.world = world
        self.camera = CameraLoop(world, clock, interval_s=camera.frame_interval_s, depth_format=depth_format)
        self._name = name
        self._config = robot
        self._camera_facts = facts_of(camera)
        self._scanner_range_m = scanner.range_m
        self._region_m = region_m
        self._clock = clock
        self._answer: Callable[[Ack], None] | None = None
        self._halted = threading.Event()
        self._dead_man = DeadMan()
        self.desk = CommandDesk(world.robot, self._acknowledge)
        self.control = ControlLoop(world.robot, self.desk, self._dead_man, clock, say)

    @property
    def taken(self) -> dict[int, TakenFrame]:
        """Frames by number."""
        return self.camera.taken

    @property
    def skipped(self) -> int:
        """Frames not taken for want of a connection or a credit."""
        return self.camera.skipped

    @property
    def late(self) -> int:
        """Frames not taken as the camera was busy."""
        return self.camera.late

    def start(self, link: Link) -> None:
        self._answer = link.acknowledge
        self.control.start()
        self.camera.start(link)

    def close(self) -> None:
        self.camera.close()
        self.control.close()

    def hello(self) -> Hello:
        return Hello(
            protocol=PROTOCOL,
            name=self._name,
            camera=self._camera_facts,
            robot=self._config.model_dump(mode="json"),
            report=self.report(),
            scanner_range_m=self._scanner_range_m,
            region_m=self._region_m,
        )

    def report(self) -> Report:
        moment = self.world.robot.moment
        time_s = self._clock.told_s(moment.state.timestamp_s)
        return report_of(moment, time_s=time_s, command=self.desk.obeyed)

    def welcomed(self, welcome: Welcome, received_s: float) -> None:
        self.desk.begin()
        # What it drives was told by a connection that is gone, and a stop may have gone with it.
        self.world.robot.stop()
        self._dead_man.arm(welcome.dead_man_s, received_s)

    def heard(self, now_s: float, received_s: float) -> None:
        self.desk.heard(now_s, received_s)
        self._dead_man.heard(received_s)

    def obey(self, command: FollowPath | Stop | LimitSpeed, received_s: float) -> None:
        if not self._halted.is_set():
            self.desk.obey(command, received_s)

    def halt(self) -> None:
        self._halted.set()
        self.desk.drop("the robot has stopped for good")
        self.world.robot.stop()

    @property
    def standing(self) -> bool:
        return self.world.robot.moment.standing

    def _acknowledge(self, ack: Ack) -> None:
        if self._answer is not None:
            self._answer(ack)


def facts_of(camera: DepthCameraConfig) -> CameraFacts:
    """A camera as it introduces itself."""
    intrinsics = camera.intrinsics()
    return CameraFacts(
        width=intrinsics.width,
        height=intrinsics.height,
        fx=intrinsics.fx,
        fy=intrinsics.fy,
        cx=intrinsics.cx,
        cy=intrinsics.cy,
        range_m=camera.range_m,
        mount_height_m=camera.mount_height_m,
        frame_interval_s=camera.frame_interval_s,
    )

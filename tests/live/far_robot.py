"""A robot that obeys at once, at the far end of a link: what the mission's side is tested with."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from app.robot.camera import scan_part
from app.robot.live_robot import facts_of
from hgs_core.errors import RobotError
from hgs_core.live.images import encoded_colour, encoded_depth
from hgs_core.live.messages import (
    PROTOCOL,
    Ack,
    Answer,
    End,
    FollowPath,
    Frame,
    Hello,
    LimitSpeed,
    Report,
    Stop,
    ToRobot,
    Welcome,
    encoded,
    to_robot,
)
from hgs_core.live.poses import numbers_of
from hgs_core.mission.config import MissionConfig, resolve_mission_config
from hgs_core.robot.path import Path as RobotPath
from hgs_core.scene.scene import open_scene
from hgs_core.sensing import frame as sensing
from hgs_core.simulation.world import SimulatedWorld

_TICK_S = 0.02
_REPORT_S = 0.1


class QueueLink:
    """A `Link` within one process; `far` is the robot's end."""

    name = "a mission"

    def __init__(self) -> None:
        self.to_robot: queue.Queue[bytes] = queue.Queue()
        self.from_robot: queue.Queue[bytes] = queue.Queue()

    def send(self, content: bytes) -> None:
        self.to_robot.put(content)

    def receive(self, timeout_s: float) -> bytes | None:
        try:
            return self.from_robot.get(timeout=timeout_s)
        except queue.Empty:
            return None


class FarRobot:
    """Lives on a thread of its own, by the wall clock; what it does on the way of a message is counted."""

    def __init__(self, config: MissionConfig, scene: Path, send: Callable[[bytes], None]) -> None:
        self._scene = open_scene(str(scene), config.scene, radius_m=0.25, height_m=config.robot.height_m)
        self._config = config
        self._send = send
        self.world = SimulatedWorld.of(
            self._scene,
            robot=config.robot,
            camera=config.sensor.camera,
            scanner=config.sensor.scanner,
            seeds=np.random.SeedSequence(0),
        )
        self.fates: list[str] = []
        self.commands: list[ToRobot] = []
        self.ended: str | None = None
        self.mute = threading.Event()
        """While set it says nothing, and stands."""
        self.blind = threading.Event()
        """While set it sends no frames."""
        self.refusing = threading.Event()
        """While set it takes no paths up."""
        self._heard: queue.Queue[ToRobot] = queue.Queue()
        self._credits = 0
        self._command = 0
        self._sequence = 0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._live, daemon=True)

    def hello(self) -> Hello:
        camera = self._config.sensor.camera
        bounds = self._scene.bounds.expanded(0.2)
        return Hello(
            protocol=PROTOCOL,
            name="far robot",
            camera=facts_of(camera),
            robot=self._config.robot.model_dump(mode="json"),
            report=self._report(),
            scanner_range_m=self._config.sensor.scanner.range_m,
            region_m=[bounds.lower_m.tolist(), bounds.upper_m.tolist()],
        )

    def begin(self) -> None:
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()

    def hear(self, content: bytes) -> None:
        self._heard.put(to_robot(content))

    def _live(self) -> None:
        self._send(encoded(self.hello()))
        next_report, next_frame, last = 0.0, 0.0, time.monotonic()
        while not self._closing.is_set() and self.ended is None:
            time.sleep(_TICK_S)
            now = time.monotonic()
            if self.mute.is_set():
                self.world.robot.stop()
            else:
                while not self._heard.empty():
                    self._obey(self._heard.get())
            self.world.robot.advance(now - last)
            last = now
            if self.mute.is_set():
                continue
            if now >= next_report:
                self._send(encoded(self._report()))
                next_report = now + _REPORT_S
            if now >= next_frame and self._credits > 0 and not self.blind.is_set():
                self._credits -= 1
                self._send(encoded(self._frame()))
                next_frame = now + self._config.sensor.camera.frame_interval_s

    def _obey(self, message: ToRobot) -> None:
        robot = self.world.robot
        if isinstance(message, Welcome):
            self._credits = message.credits
        elif isinstance(message, Answer):
            self._credits += 1
            self.fates.append(message.fate)
        elif isinstance(message, End):
            robot.stop()
            self.ended = message.reason
        elif isinstance(message, FollowPath | Stop | LimitSpeed):
            self.commands.append(message)
            self._send(encoded(self._acked(message)))

    def _acked(self, message: FollowPath | Stop | LimitSpeed) -> Ack:
        robot = self.world.robot
        if isinstance(message, Stop):
            robot.stop()
        elif isinstance(message, LimitSpeed):
            robot.limit_speed(message.max_speed_mps)
        else:
            path = RobotPath(
                positions_m=np.array(message.positions_m),
                yaws_rad=np.array([np.nan if yaw is None else yaw for yaw in message.yaws_rad]),
                headings_rad=None if message.headings_rad is None else np.array(message.headings_rad),
            )
            if self.refusing.is_set():
                return Ack(command=message.command, accepted=False, reason="not now")
            try:
                robot.follow(path)
            except RobotError as error:
                return Ack(command=message.command, accepted=False, reason=str(error)[:300])
        self._command = max(self._command, message.command)
        return Ack(command=message.command, accepted=True)

    def _report(self) -> Report:
        robot, state = self.world.robot, self.world.robot.state
        return Report(
            time_s=state.timestamp_s,
            x_m=state.x_m,
            y_m=state.y_m,
            yaw_rad=state.yaw_rad,
            path_length_m=state.path_length_m,
            standing=robot.arrived and robot.standing_in_s == 0.0,
            command=self._command,
            waypoints_passed=robot.waypoints_passed,
            arrived=robot.arrived,
            collisions=state.collisions,
            reversing=state.reversing,
        )

    def _frame(self) -> Frame:
        self._sequence += 1
        taken, scan = self.world.camera.capture(), self.world.scanner.scan()
        time_s = self.world.robot.state.timestamp_s + 1e-6 * self._sequence
        return frame_message(taken, scan, sequence=self._sequence, time_s=time_s)


def frame_message(taken: sensing.Frame, scan: sensing.Scan | None, *, sequence: int, time_s: float) -> Frame:
    """A frame as it travels."""
    return Frame(
        sequence=sequence,
        time_s=time_s,
        pose=numbers_of(taken.T_world_camera),
        colour=encoded_colour(taken.rgb),
        depth=encoded_depth(taken.depth_m),
        scan=None if scan is None else scan_part(scan),
    )


def far_config(**overrides: str) -> MissionConfig:
    """Small missions' settings; the robot's and its mission's are the same."""
    settings = {"sensor": "rgbd_5m_tiny", "threads": "1", "mesh.enabled": "false", "live.dead_man_s": "0.5"}
    return resolve_mission_config("quick", {**settings, **overrides})

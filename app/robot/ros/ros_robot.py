"""`RosRobot`: a robot behind a rosbridge server, on board of a mission."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from app.robot.clock import RobotClock
from app.robot.commands import CommandDesk
from app.robot.dead_man import DeadMan
from app.robot.onboard import Link
from app.robot.ros.camera import RosCamera
from app.robot.ros.complaints import Complaints
from app.robot.ros.content import PATH, TWIST, path_content, read, twist_content
from app.robot.ros.driver import TICK_S, RosDriver
from app.robot.ros.fittings import Bridge, heard_fittings, unheard
from app.robot.ros.odometry import ClockSetBack, OdometryMoment, OdometryTrack
from app.robot.ros.topics import LASER_SCAN, RosTopicOptions, chosen_topics
from app.robot.telling import camera_facts, depth_camera_facts, report_of
from hgs_core.errors import StreamError
from hgs_core.geometry.se3 import SE3
from hgs_core.live.messages import (
    PROTOCOL,
    Ack,
    Bye,
    FollowPath,
    Hello,
    LimitSpeed,
    Report,
    Stop,
    Welcome,
)
from hgs_core.robot.motion import Twist
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotConfig
from hgs_core.sensing.ros.poses import ODOMETRY


@dataclass(frozen=True, kw_only=True)
class RosRobotOptions:
    name: str
    drive: RobotConfig
    topics: RosTopicOptions = field(default_factory=RosTopicOptions)
    camera_on_base: SE3 | None = None
    """Pose of the colour camera's optical frame on the base; None = as /tf_static tells."""
    velocity_topic: str = "/cmd_vel"
    path_topic: str = "/hgs/path"
    range_m: float = 5.0
    frame_interval_s: float = 0.4
    patience_s: float = 10.0
    """What the robot says once, or always, has to be heard within this."""


class RosRobot:
    """Implements `Onboard`. Raises `StreamError` for what the robot does not tell in time."""

    def __init__(
        self, bridge: Bridge, options: RosRobotOptions, clock: RobotClock, say: Callable[[str], None]
    ) -> None:
        self.error: StreamError | None = None
        """Why it broke off, if it did."""
        self.dead_man_stops = 0
        self._bridge = bridge
        self._options = options
        self._clock = clock
        self._say = say
        self._link: Link | None = None
        self._complain = Complaints(say)
        self._schemas = bridge.topics()
        self.topics = chosen_topics(self._schemas, options.topics, source=bridge.url)
        published = self._schemas.get(options.velocity_topic, TWIST)
        if published != TWIST:
            raise StreamError(
                f"{bridge.url}: {options.velocity_topic} is a topic of {published}, not of {TWIST}: have its "
                "controller take unstamped velocities, or name another with --velocity-topic"
            )
        limits = options.topics
        self.odometry = OdometryTrack(offset_s=limits.max_pose_offset_s, gap_s=limits.max_pose_gap_s)
        self._heard_odometry = threading.Event()
        first = self._first_odometry()
        self._world_frame = first.world_frame
        self._fittings = heard_fittings(
            bridge,
            self.topics,
            first.base_frame,
            camera_on_base=options.camera_on_base,
            depth_is_registered=limits.depth_is_registered,
            patience_s=options.patience_s,
        )
        self._velocity = bridge.publisher(options.velocity_topic, TWIST)
        self._path = bridge.publisher(options.path_topic, PATH)
        self.driver = RosDriver(options.drive, self.odometry, self._drive, self._show, clock.now_s)
        self.desk = CommandDesk(self.driver, self._acknowledge)
        self._dead_man = DeadMan()
        self._halted = threading.Event()
        self._over = threading.Event()
        self._control = threading.Thread(target=self._live, name="ros-control", daemon=True)
        self.camera = RosCamera(
            self.odometry,
            clock,
            T_base_camera=self._fittings.T_base_camera,
            T_base_laser=self._fittings.T_base_laser,
            interval_s=options.frame_interval_s,
            max_depth_offset_s=limits.max_depth_offset_s,
            say=say,
        )

    def start(self, link: Link) -> None:
        self._link = link
        self._control.start()
        self.camera.start(link)
        images, camera, schemas = self.topics.images, self.camera, self._schemas
        subscribe = self._bridge.subscribe
        subscribe(images.colour, schemas[images.colour], partial(camera.hear_colour, where=images.colour))
        subscribe(images.depth, schemas[images.depth], partial(camera.hear_depth, where=images.depth))
        if self.topics.scan is not None:
            subscribe(self.topics.scan, LASER_SCAN, partial(camera.hear_scan, where=self.topics.scan))

    def close(self) -> None:
        self.camera.close()
        self._over.set()
        self._control.join()
        self.driver.drop()

    def hello(self) -> Hello:
        options, fitted = self._options, self._fittings
        return Hello(
            protocol=PROTOCOL,
            name=options.name,
            camera=camera_facts(
                fitted.colour,
                range_m=options.range_m,
                frame_interval_s=options.frame_interval_s,
                mount_height_m=float(fitted.T_base_camera.translation[2]),
            ),
            depth_camera=depth_camera_facts(fitted.depth, fitted.colour, fitted.T_colour_depth),
            robot=options.drive.model_dump(mode="json"),
            report=self._report(),  # a hello without one is refused, and is said once a connection
        )

    def report(self) -> Report | None:
        """None while nothing is heard of the robot: what it was is no news."""
        return None if self.driver.stale else self._report()

    def _report(self) -> Report:
        moment = self.driver.moment
        return report_of(moment, time_s=moment.state.timestamp_s, command=self.desk.obeyed)

    def welcomed(self, welcome: Welcome, received_s: float) -> None:
        self.desk.begin()
        self.driver.stop()  # what it drives was told by a connection that is gone
        self._dead_man.arm(welcome.dead_man_s, received_s)

    def heard(self, now_s: float, received_s: float) -> None:
        self.desk.heard(now_s, received_s)
        self._dead_man.heard(received_s)

    def obey(self, command: FollowPath | Stop | LimitSpeed, received_s: float) -> None:
        if self._halted.is_set():
            return
        self.desk.obey(command, received_s)
        if self._halted.is_set():  # by another thread, meanwhile
            self.halt()

    def halt(self) -> None:
        self._halted.set()
        self.desk.drop("the robot has stopped for good")
        self.driver.stop()

    @property
    def standing(self) -> bool:
        return self.driver.stale or self.driver.moment.standing

    def _live(self) -> None:
        try:
            while not self._over.wait(TICK_S):
                self._tick()
        except Exception as error:  # whatever it is: a robot that nobody controls must stand, and say so
            self._break_off(StreamError(f"the control loop broke off: {error!r}"))
            self.driver.drop()

    def _tick(self) -> None:
        if self._dead_man.trips(self._clock.now_s()):
            self.dead_man_stops += 1
            self._say(f"nothing heard for {self._dead_man.limit_s:g} s: the robot brakes")
            self.desk.drop("nothing was heard of the service: the robot has stopped by itself")
            self.driver.stop()
        self.driver.tick()
        if self.driver.stale:
            self.desk.drop("nothing is heard of the robot's odometry, or too late")
        self.desk.settle()

    def _drive(self, twist: Twist) -> None:
        self._velocity(twist_content(twist))

    def _show(self, path: Path | None) -> None:
        newest = self.odometry.newest
        stamp_s = 0.0 if newest is None else newest.stamp_s
        self._path(path_content(path, frame=self._world_frame, stamp_s=stamp_s))

    def _acknowledge(self, ack: Ack) -> None:
        if self._link is not None:
            self._link.acknowledge(ack)

    def _hear_odometry(self, content: dict[str, Any]) -> None:
        topic, received_s = self.topics.odometry, self._clock.now_s()
        try:
            read(content, lambda message, where: self.odometry.add(message, where, received_s), topic)
        except ClockSetBack as error:
            self._break_off(error)
        except StreamError as error:
            self._complain(error)
        else:
            self._heard_odometry.set()

    def _break_off(self, error: StreamError) -> None:
        if self.error is None and self._link is not None:
            self.error = error
            self.halt()
            self._link.finish(Bye(reason="the robot cannot go on: see what its program says"))

    def _first_odometry(self) -> OdometryMoment:
        self._bridge.subscribe(self.topics.odometry, ODOMETRY, self._hear_odometry)
        patience_s = self._options.patience_s
        if not self._heard_odometry.wait(patience_s) or (first := self.odometry.newest) is None:
            raise unheard(self._bridge, self.topics.odometry, patience_s)
        return first

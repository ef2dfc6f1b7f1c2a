"""`hgs ros` as a program: a mission, and a robot behind a rosbridge server that drives through it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field

from app.robot.clock import RobotClock
from app.robot.figures import Delays, LinkFigures
from app.robot.mission import client_for, new_mission, until_over
from app.robot.outcome import Outcome
from app.robot.rest import ServiceApi
from app.robot.ros.bridge import Rosbridge
from app.robot.ros.ros_robot import RosRobot, RosRobotOptions


@dataclass(frozen=True, kw_only=True)
class RosOptions:
    """The options of `hgs ros`."""

    bridge: str
    server: str
    robot: RosRobotOptions
    token: str | None = None
    mission: str | None = None
    """None: one is made, and started."""
    preset: str = "best"
    settings: dict[str, str] = field(default_factory=dict)
    give_up_after_s: float = 60.0


@dataclass(frozen=True, kw_only=True)
class RosRun:
    """How it went."""

    mission: str
    outcome: Outcome
    ending: str
    path_length_m: float
    skipped: int
    unread: int
    commands_obeyed: int
    commands_refused: int
    dead_man_stops: int
    link: LinkFigures

    @property
    def sent_to_map_s(self) -> Delays:
        return Delays.of(self.link.sent_to_map_s)


def run_ros(options: RosOptions, say: Callable[[str], None]) -> RosRun:
    """Connect to both sides, and live through the mission.

    Raises an `HgsError` for what the robot does not tell, or the service refuses, and `OSError` where the
    service does not answer at the beginning.
    """
    bridge = Rosbridge(options.bridge)
    try:
        return _driven(bridge, options, say)
    finally:
        bridge.close()


def _driven(bridge: Rosbridge, options: RosOptions, say: Callable[[str], None]) -> RosRun:
    clock = RobotClock(0.0)
    robot = RosRobot(bridge, options.robot, clock, say)
    images = robot.topics.images
    say(
        f"colour {images.colour}, depth {images.depth}, poses {robot.topics.odometry}, "
        f"scans {robot.topics.scan or 'none'}"
    )
    api = ServiceApi(options.server, options.token)
    mission = options.mission or new_mission(
        api, preset=options.preset, seed=0, overrides=options.settings, say=say
    )
    client = client_for(
        api,
        mission,
        robot,
        token=options.token,
        clock=clock,
        give_up_after_s=options.give_up_after_s,
        say=say,
    )
    outcome = asyncio.run(until_over(client))
    if robot.error is not None:
        raise robot.error
    newest = robot.odometry.newest
    return RosRun(
        mission=mission,
        outcome=outcome,
        ending=client.ending,
        path_length_m=0.0 if newest is None else newest.path_length_m,
        skipped=robot.camera.skipped,
        unread=robot.camera.unread,
        commands_obeyed=robot.desk.accepted,
        commands_refused=robot.desk.refused,
        dead_man_stops=robot.dead_man_stops,
        link=client.figures,
    )

"""How a mission with a live robot begins: it waits for the robot, and takes its sensors and drive from it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from hgs_core.errors import CheckpointError, ConfigError, RobotError
from hgs_core.geometry.se3 import SE3
from hgs_core.live.cameras import RobotCameras
from hgs_core.live.correspondence import Correspondence
from hgs_core.live.link import Link
from hgs_core.live.messages import Hello
from hgs_core.live.world import LiveWorld
from hgs_core.localisation.given import GivenConfig
from hgs_core.localisation.methods import build_localiser
from hgs_core.mission.clock import ClockKind
from hgs_core.mission.commands import Command, CommandSource, Order, PromptCommands
from hgs_core.mission.config import MissionConfig
from hgs_core.robot.vehicle import robot_config, vehicle_of

_LOOK_S = 0.1


class Suspended(Exception):
    """The mission was suspended before there was anything to save."""


class OrdersBefore:
    """A `PromptCommands` that keeps what is said while nobody can obey, for whoever polls later."""

    def __init__(self, source: CommandSource) -> None:
        self._source = source
        self._kept: deque[Order] = deque()

    def poll(self) -> Order | None:
        return self._kept.popleft() if self._kept else self._source.poll()

    def on_stop(self, react: Callable[[], None]) -> None:
        if isinstance(self._source, PromptCommands):
            self._source.on_stop(react)

    def heard(self, command: Command) -> bool:
        """Whether that command has come meanwhile."""
        while (order := self._source.poll()) is not None:
            self._kept.append(order)
        return command in self._kept


def meet_robot(
    link: Link,
    config: MissionConfig,
    *,
    earlier: dict[str, Any] | None,
    orders: OrdersBefore,
    say: Callable[[str], None],
    notice: Callable[[float, str], None],
) -> tuple[MissionConfig, LiveWorld]:
    """Wait until a robot says hello and sends a frame; the settings with its camera and its drive in them,
    and its world.

    `earlier`: the state of the world of a mission that goes on, whose robot must be the same. Raises
    `RobotError` when the mission is stopped before, `Suspended` when it is suspended, `CheckpointError` for
    another robot, and `ConfigError` for a localisation that cannot be.
    """
    build_localiser(config.localisation, start=SE3.identity())  # raises here what it needs and does not find
    correspondence = Correspondence(
        link,
        config.live,
        localiser_from=lambda start: build_localiser(config.localisation, start=start),
        earlier=None if earlier is None else earlier["correspondence"],
        notice=notice,
    )
    correspondence.begin()
    try:
        return _met(correspondence, config, known=earlier is not None, orders=orders, say=say)
    except BaseException:
        correspondence.close()
        raise


def _met(
    correspondence: Correspondence,
    config: MissionConfig,
    *,
    known: bool,
    orders: OrdersBefore,
    say: Callable[[str], None],
) -> tuple[MissionConfig, LiveWorld]:
    def wait_for(there: Callable[[], bool], what: str) -> None:
        say(f"waits for {what}")
        while not correspondence.wait_for_news(_LOOK_S, there):
            if orders.heard(Command.STOP):
                raise RobotError(f"stopped while it waited for {what}")
            if orders.heard(Command.SUSPEND):
                raise Suspended

    wait_for(lambda: correspondence.hello is not None, "a robot to say hello")
    hello = correspondence.hello
    assert hello is not None
    wait_for(
        lambda: correspondence.has_frame or correspondence.over is not None, f"a frame from {hello.name}"
    )
    if hello.robot is not None and not isinstance(config.localisation, GivenConfig):
        raise ConfigError(
            f"localisation.method = {config.localisation.method!r} is for cameras that are carried: a robot "
            "that drives knows where it is; set it to given"
        )
    theirs = with_robot(config, hello)
    if known and (theirs.sensor, theirs.robot) != (config.sensor, config.robot):
        raise CheckpointError(
            f"{hello.name} is another robot than the mission began with: its camera or its drive differs"
        )
    return theirs, LiveWorld(correspondence, hello, vehicle_of(theirs.robot), theirs.live)


def with_robot(config: MissionConfig, hello: Hello) -> MissionConfig:
    """The settings with what the robot says of its camera, scanner and drive; the clock is the real one, and
    nothing is known to compare the map with."""
    facts, seen = hello.camera, RobotCameras.of(hello).colour.undistorted()
    camera = config.sensor.camera.model_copy(
        update={
            "width": seen.width,
            "height": seen.height,
            "focal_px": seen.fx,
            "focal_y_px": seen.fy,
            "centre_px": (seen.cx, seen.cy),
            "range_m": facts.range_m,
            "mount_height_m": facts.mount_height_m,
            "frame_interval_s": facts.frame_interval_s,
        }
    )
    scanner = config.sensor.scanner.model_copy(update={"range_m": hello.scanner_range_m})
    return config.model_copy(
        update={
            "sensor": config.sensor.model_copy(update={"camera": camera, "scanner": scanner}),
            "robot": config.robot if hello.robot is None else robot_config(hello.robot),
            "clock": ClockKind.REAL,
            "evaluate": False,
            "curve_interval_m": 0.0,
        }
    )

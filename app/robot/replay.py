"""`hgs replay` as a program: a mission, and a recording that is sent to it as if it happened now."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from app.robot.carried_camera import CarriedCamera
from app.robot.clock import RobotClock
from app.robot.figures import Delays, LinkFigures
from app.robot.mission import client_for, new_mission, until_over
from app.robot.outcome import Outcome
from app.robot.recorded_lidar import RecordedLidar, takes_clouds
from app.robot.rest import ServiceApi
from app.robot.stream_playback import StreamPlayback
from hgs_core.sensing.raw_frame import FrameSource
from hgs_core.sensing.recording import open_recording
from hgs_core.sensing.ros.topics import TopicOptions


@dataclass(frozen=True, kw_only=True)
class ReplayOptions:
    """The options of `hgs replay`."""

    source: Path
    server: str
    token: str | None = None
    mission: str | None = None
    """None: one is made, and started."""
    preset: str = "best"
    settings: dict[str, str] = field(default_factory=dict)
    seed: int = 0
    topics: TopicOptions | None = None
    speed: float = 1.0
    every_frame: bool = False
    with_poses: bool = True
    range_m: float = 5.0
    depth_format: str = "zstd"
    give_up_after_s: float = 60.0


@dataclass(frozen=True, kw_only=True)
class ReplayRun:
    """How it went."""

    mission: str
    outcome: Outcome
    ending: str
    n_frames: int
    skipped: int
    link: LinkFigures

    @property
    def sent_to_map_s(self) -> Delays:
        return Delays.of(self.link.sent_to_map_s)


def run_replay(options: ReplayOptions, say: Callable[[str], None]) -> ReplayRun:
    """Send the whole recording, and wait until the mission has taken its end in.

    Clouds of a lidar go to a mission that is made with `localisation.method` `lidar-odometry`, and to any
    other when their topic is named: nothing else uses them. A mission that is made is told how the camera
    sits on the lidar, unless the settings say it.

    Raises an `HgsError` for a recording that cannot be read or what the service refuses, and `OSError` where
    the service does not answer at the beginning.
    """
    source = open_recording(options.source, options.topics)
    playback = StreamPlayback(
        source,
        range_m=options.range_m,
        speed=options.speed,
        depth_format=options.depth_format,
        with_poses=options.with_poses,
    )
    lidar, mounting = _lidar(source, options)
    for key, value in mounting.items():
        say(f"{key}={value}, from tf")
    api = ServiceApi(options.server, options.token)
    mission = options.mission or new_mission(
        api, preset=options.preset, seed=options.seed, overrides=options.settings | mounting, say=say
    )
    clock = RobotClock(0.0)
    camera = CarriedCamera(
        playback,
        clock,
        name=source.name,
        clouds=() if lidar is None else lidar.scans,
        speed=options.speed,
        waits=options.every_frame,
    )
    client = client_for(
        api,
        mission,
        camera,
        token=options.token,
        clock=clock,
        give_up_after_s=options.give_up_after_s,
        say=say,
    )
    outcome = asyncio.run(until_over(client))
    if camera.error is not None:
        raise camera.error
    return ReplayRun(
        mission=mission,
        outcome=outcome,
        ending=client.ending,
        n_frames=len(source),
        skipped=camera.skipped,
        link=client.figures,
    )


def _lidar(source: FrameSource, options: ReplayOptions) -> tuple[RecordedLidar | None, dict[str, str]]:
    """The lidar whose clouds are wanted, and settings that a mission is to be made with for it."""
    is_made_for_it = options.mission is None and takes_clouds(options.settings)
    topic = None if options.topics is None else options.topics.cloud
    if not is_made_for_it and topic is None:
        return None, {}
    lidar = RecordedLidar(source, options.source, topic)
    return lidar, lidar.mounting(options.settings) if is_made_for_it else {}

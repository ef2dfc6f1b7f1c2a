"""`hgs robot` as a program: a mission, a robot in it, and what the robot leaves behind."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from app.robot.carried_camera import CarriedCamera
from app.robot.client import RobotClient
from app.robot.clock import RobotClock
from app.robot.figures import Delays, RobotReport
from app.robot.link_faults import FrameFaults
from app.robot.live_robot import LiveRobot
from app.robot.mission import mission_word, new_mission, until_over
from app.robot.options import RobotOptions
from app.robot.outcome import MissionWord, Outcome
from app.robot.recording import FrameRecording
from app.robot.rest import Refused, ServiceApi
from app.robot.results import (
    download_results,
    evaluated,
    finished_mission,
    report_of,
    write_paths,
)
from hgs_core.errors import ConfigError, RobotError
from hgs_core.evaluation.report import MissionReport
from hgs_core.native import kernels
from hgs_core.scene.scene import Scene, open_scene
from hgs_core.simulation.driven_world import DrivenWorld

REGION_MARGIN_M: Final = 0.2
_RESULTS_S: Final = 900.0
"""Mesh and evaluation take the service so long at most."""


@dataclass(frozen=True, kw_only=True)
class RobotRun:
    """How it went."""

    outcome: Outcome
    report: MissionReport
    robot: RobotReport


def run_robot(options: RobotOptions, say: Callable[[str], None]) -> RobotRun:
    """Connect, live through the mission, and write the results into `options.out`.

    Raises an `HgsError` for what is wrong with the options or refused by the service, and `OSError` where the
    service does not answer at the beginning; nothing is written then.
    """
    out = options.out
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ConfigError(f"{out} exists already: choose another folder or remove it first")
    return _Program(options, say).run()


class _Program:
    def __init__(self, options: RobotOptions, say: Callable[[str], None]) -> None:
        self._options = options
        self._say = say
        self._config = options.config()
        self._recording = None if options.recorded is None else FrameRecording(options.recorded)
        self._api = ServiceApi(options.server, options.token)
        self._scene = self._opened()
        kernels.set_threads(1)  # the rest of the machine is the service's

    def run(self) -> RobotRun:
        options = self._options
        robot_seeds, link_seed = np.random.SeedSequence(options.seed).spawn(2)
        mission = self._mission()
        clock = RobotClock(options.clock_offset_s)
        onboard = self._onboard(robot_seeds, clock)
        frame_faults = FrameFaults(options.link_faults, np.random.default_rng(link_seed))
        client = RobotClient(
            self._api.ingest_url(mission),
            onboard,
            token=options.token,
            clock=clock,
            faults=options.link_faults,
            frame_faults=frame_faults,
            give_up_after_s=options.give_up_after_s,
            mission_word=lambda: self._word(mission),
            say=self._say,
        )
        began_s = time.monotonic()
        outcome = asyncio.run(until_over(client))
        wall_s = time.monotonic() - began_s
        self._say(f"the robot stands: {client.ending}")
        figures = self._figures(mission, onboard, client, frame_faults, wall_s)
        options.out.mkdir(parents=True, exist_ok=True)
        write_paths(options.out, list(onboard.taken.values()))
        figures.write(options.out / "robot.json")
        if isinstance(onboard, CarriedCamera) and onboard.error is not None:
            raise onboard.error
        report = self._report(mission, onboard, client, outcome, wall_s)
        report.write(options.out / "report.json")
        return RobotRun(outcome=outcome, report=report, robot=figures)

    def _opened(self) -> Scene | None:
        """The true scene; None for a recording that nobody compares with anything."""
        source = self._options.scene or (None if self._recording is None else self._recording.facts.scene)
        if source is None:
            raise ConfigError("--scene is missing: the robot has to be somewhere")
        if self._recording is not None and not self._options.evaluate:
            return None
        self._say(f"opening scene {source}")
        robot = self._config.robot
        scene = open_scene(source, self._config.scene, radius_m=robot.radius_m, height_m=robot.height_m)
        for notice in scene.notices:
            self._say(notice)
        return scene

    def _mission(self) -> str:
        options = self._options
        if options.mission is not None:
            try:
                word = self._word(options.mission)
            except (OSError, Refused) as error:
                if isinstance(error, Refused) and error.status < 500:
                    raise
                self._say(f"the service is not there yet: {error}")  # the connection is tried for long enough
                return options.mission
            if word.over is not None:
                raise RobotError(f"mission {options.mission} takes no robot: {word.over}")
            return options.mission
        return new_mission(
            self._api, preset=options.preset, seed=options.seed, overrides=options.overrides(), say=self._say
        )

    def _word(self, mission: str) -> MissionWord:
        """A robot's token opens the way in alone: then the service's close codes have to tell."""
        try:
            return mission_word(self._api.mission(mission))
        except Refused as error:
            if error.status != 403:
                raise
            return MissionWord()

    def _onboard(self, seeds: np.random.SeedSequence, clock: RobotClock) -> LiveRobot | CarriedCamera:
        options, config = self._options, self._config
        if self._recording is not None:
            return CarriedCamera(self._recording, clock, name=f"recording of {self._recording.facts.scene}")
        assert self._scene is not None
        world = DrivenWorld.of(
            self._scene,
            robot=config.robot,
            camera=config.sensor.camera,
            scanner=config.sensor.scanner,
            faults=options.body_faults,
            seeds=seeds,
        )
        return LiveRobot(
            world,
            name=f"{options.vehicle} robot in {self._scene.name}",
            robot=config.robot,
            camera=config.sensor.camera,
            scanner=config.sensor.scanner,
            region_m=region_of(self._scene),
            depth_format=options.depth_format,
            clock=clock,
            say=self._say,
        )

    def _figures(
        self,
        mission: str,
        onboard: LiveRobot | CarriedCamera,
        client: RobotClient,
        frame_faults: FrameFaults,
        wall_s: float,
    ) -> RobotReport:
        link, live = client.figures, onboard if isinstance(onboard, LiveRobot) else None
        return RobotReport(
            mission=mission,
            ending=client.ending,
            seed=self._options.seed,
            vehicle=None if live is None else self._options.vehicle,
            faults=self._options.faults(),
            frames_sent=link.sent,
            frames_taken=link.taken,
            frames_dropped=link.dropped,
            frames_refused=link.refused,
            frames_unanswered=link.sent - link.taken - link.dropped - link.refused,
            frames_skipped=onboard.skipped,
            frames_late=onboard.late,
            frames_lost=link.lost + frame_faults.lost,
            frames_overtaken=frame_faults.overtaken,
            connections=link.connections,
            reconnects=max(link.connections - 1, 0),
            not_understood=link.not_understood,
            refusals=link.refusals,
            commands_obeyed=0 if live is None else live.desk.accepted,
            commands_refused=0 if live is None else live.desk.refused,
            dead_man_stops=0 if live is None else live.control.dead_man_stops,
            dead_man_stopping_m=() if live is None else tuple(live.control.stopping_m),
            sent_to_map_s=Delays.of(link.sent_to_map_s),
            captured_to_map_s=Delays.of(link.captured_to_map_s),
            real_time_factor=None if live is None else live.control.lived_s / wall_s,
            control_late_s=Delays() if live is None else Delays.of(live.control.late_s),
        )

    def _report(
        self,
        mission: str,
        onboard: LiveRobot | CarriedCamera,
        client: RobotClient,
        outcome: Outcome,
        wall_s: float,
    ) -> MissionReport:
        options, theirs, detail = self._options, None, None
        if outcome is Outcome.ENDED:
            detail, theirs = self._what_is_left(mission)
        own: dict[str, Any] = {
            "scene": options.scene or "live" if self._scene is None else self._scene.name,
            "seed": options.seed,
            "preset": options.preset,
            "planner": options.preset if theirs is None else theirs.planner,
            "clock": "real",
            "wall_s": wall_s,
            "frames": client.figures.sent,
            "frames_dropped": client.figures.dropped,
        }
        if isinstance(onboard, LiveRobot):
            state = onboard.world.robot.state
            own |= {
                "path_length_m": state.path_length_m,
                "collisions": state.collisions,
                "simulation_wall_s": onboard.camera.busy_s,
            }
        report = report_of(theirs, detail, own=own, message=client.ending)
        if outcome is not Outcome.ENDED or self._scene is None or not options.evaluate:
            return report
        taken = [onboard.taken[k] for k in client.figures.taken_sequences if k in onboard.taken]
        self._say("comparing the map with the true scene")
        found = evaluated(self._scene, self._config, options.out, taken)
        return report if found is None else report.with_evaluation(found)

    def _what_is_left(self, mission: str) -> tuple[dict[str, Any] | None, MissionReport | None]:
        """The mission's detail and report, its map downloaded; None where a token does not open them."""
        try:
            detail = finished_mission(self._api, mission, patience_s=_RESULTS_S, say=self._say)
            return detail, download_results(self._api, mission, self._options.out)
        except Refused as error:
            if error.status != 403:
                raise
            self._say(f"the map stays with the service, and is not compared with anything: {error}")
            return None, None


def region_of(scene: Scene) -> list[list[float]]:
    """What is to be explored, as an operator would give it: the scene's box and a little more."""
    box = scene.bounds.expanded(REGION_MARGIN_M)
    return [box.lower_m.tolist(), box.upper_m.tolist()]

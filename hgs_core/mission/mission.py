"""The loop: sense, map, plan, move."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from hgs_core.gaussians.render import render
from hgs_core.mapping.mapper import IntegrationReport, Mapper
from hgs_core.mission.clock import Clock, ClockKind
from hgs_core.mission.commands import CommandSource, PromptCommands
from hgs_core.mission.config import MissionLimits
from hgs_core.mission.events import (
    MissionEnded,
    MissionObserver,
    MissionPhase,
    MissionView,
    PhaseChanged,
    Telemetry,
    rgb_to_uint8,
)
from hgs_core.mission.operator import Operator
from hgs_core.mission.pilot import Pilot
from hgs_core.mission.record import MissionRecord
from hgs_core.planning.directives import Directives
from hgs_core.planning.navigator import Navigator
from hgs_core.planning.plan import Insight, Insightful, Planner
from hgs_core.robot.robot import Robot
from hgs_core.robot.vehicle import Vehicle
from hgs_core.sensing.frame import Frame, Scan
from hgs_core.sensing.sensor import Scanner, Sensor

_POLL_S = 0.05
_WAIT_POLL_S = 0.5


class Mission:
    """Drives one robot until nothing worth seeing is left.

    The loop is the same whether `robot`, `sensor` and `scanner` are simulated or real, and by either clock;
    the planner sees the maps and the robot's state, never what lies behind the sensors.
    """

    def __init__(
        self,
        *,
        robot: Robot,
        vehicle: Vehicle,
        sensor: Sensor,
        scanner: Scanner,
        mapper: Mapper,
        planner: Planner,
        planner_rng: np.random.Generator,
        limits: MissionLimits,
        clock: Clock,
        observer: MissionObserver,
        commands: CommandSource,
        navigator: Navigator,
        directives: Directives,
        why_wait: Callable[[], str | None] = lambda: None,
        why_over: Callable[[], str | None] = lambda: None,
        on_mapped: Callable[[Frame], None] = lambda _: None,
    ) -> None:
        """`why_wait` is asked before every frame: a reason why there can be none now, or None; `why_over`:
        why there will be none any more. `on_mapped` is told of every frame that is in the map.
        """
        self.record = MissionRecord()
        self._robot = robot
        self._sensor = sensor
        self._scanner = scanner
        self._mapper = mapper
        self._planner = planner
        self._planner_rng = planner_rng
        self._clock = clock
        self._observer = observer
        self._why_wait = why_wait
        self._why_over = why_over
        self._on_mapped = on_mapped
        self._operator = Operator(commands)
        self._pilot = Pilot(
            robot=robot,
            vehicle=vehicle,
            mapper=mapper,
            planner=planner,
            planner_rng=planner_rng,
            navigator=navigator,
            limits=limits,
            clock=clock,
            operator=self._operator,
            directives=directives,
            why_over=why_over,
            tell=observer.on_event,
        )
        self.record.planning = self._pilot.planning
        self._began = False
        self._began_s = time.perf_counter()
        if isinstance(commands, PromptCommands):
            commands.on_stop(self._pilot.halt)

    def run(self, *, between_frames: Callable[[], None] = lambda: None) -> MissionRecord:
        """Explore until done, from the start or from what was restored. Returns the record; one without a
        `stop_reason` is that of a mission that was suspended. Raises only `HgsError`s of the parts.

        `between_frames` is called whenever `state` may be taken.
        """
        self._begin()
        while (ended := self._pilot.ended) is None:
            self._wait_until_possible()
            if self._operator.suspend_requested and not self._operator.stop_requested:
                return self.record
            no_more = self._operator.stop_requested or self._why_over() is not None
            if no_more and self._pilot.should_end():
                continue
            self.step()
            if self._pilot.ended is None:
                between_frames()
        self.record.stop_reason, self.record.message = ended.reason, ended.message
        self.record.unseen = ended.unseen
        self._mapper.prune()
        self._observer.on_event(
            MissionEnded(time_s=self.time_s, stop_reason=ended.reason, message=ended.message)
        )
        return self.record

    def step(self) -> None:
        """One frame: sense, map, plan, learn from frames until the next is due, move."""
        scan, frame = self._sense()
        report = self._integrate(scan, frame)
        self._obey_commands()
        self._pilot.decide()
        self._show(frame)
        self._optimise()
        self._report_progress(frame, report)
        if self._pilot.ended is None:
            self._go_on_to_next_frame()

    def state(self) -> dict[str, Any]:
        """Everything that later frames and the report depend on, but what lies behind the seams `Robot`,
        `Sensor` and `Scanner`; to be taken between two frames (see `GaussianMap.state`).
        """
        return {
            "mapper": self._mapper.state(),
            "planner": self._planner.state(),
            "planner_rng": self._planner_rng.bit_generator.state,
            "pilot": self._pilot.state(),
            "clock": self._clock.state(),
            "record": self.record.state(),
            "wall_s": self.wall_s,
        }

    def restore(self, state: dict[str, Any], *, keyframe_folder: FilePath) -> None:
        """Go on from `state`, in the place where it was taken; keyframes' images lie in `keyframe_folder`."""
        self._mapper.restore(state["mapper"], keyframe_folder=keyframe_folder)
        self.record = MissionRecord.restore(state["record"])
        self._pilot.restore(state["pilot"], planning=self.record.planning)
        self._planner.restore(state["planner"])
        self._planner_rng.bit_generator.state = state["planner_rng"]
        self._clock.restore(state["clock"])
        self._began_s = time.perf_counter() - state["wall_s"]
        self._began = True

    @property
    def time_s(self) -> float:
        """Mission time."""
        return self._robot.state.timestamp_s

    @property
    def wall_s(self) -> float:
        """Wall seconds since it began, those of earlier processes included."""
        return time.perf_counter() - self._began_s

    def _begin(self) -> None:
        if self._began:
            self._announce(self._pilot.phase, f"going on from {self.time_s:.1f} s")
            return
        self._began = True
        known = self._mapper.gaussians.size > 0
        self._announce(MissionPhase.RUNNING, "extending an old map" if known else "looking around")
        self._pilot.begin()

    def _sense(self) -> tuple[Scan, Frame]:
        with self._clock.stopped():
            began = time.perf_counter()
            scan, frame = self._scanner.scan(), self._sensor.capture()
            self.record.sensing_s.append(time.perf_counter() - began)
        return scan, frame

    def _integrate(self, scan: Scan, frame: Frame) -> IntegrationReport:
        began = time.perf_counter()
        self._mapper.integrate_scan(scan)
        report = self._mapper.integrate(frame, may_thin=self._clock.kind is ClockKind.REAL)
        self.record.mapping_s.append(time.perf_counter() - began)
        self._on_mapped(frame)
        self.record.frames_thinned += report.thinned
        self.record.poses.append(frame.T_world_camera)
        self.record.timestamps_s.append(frame.timestamp_s)
        return report

    def _optimise(self) -> None:
        if self._pilot.ended is not None:
            return
        began = time.perf_counter()
        self.record.iterations += self._mapper.optimise(
            interrupted=self._stop_pending, time_left=self._clock.time_left
        )
        self.record.mapping_s[-1] += time.perf_counter() - began

    def _go_on_to_next_frame(self) -> None:
        due = self._clock.next_frame(interrupted=self._stop_pending)
        if self._pilot.awaits is not None and self._clock.kind is ClockKind.LOCKSTEP:
            self._let_the_operator_think(due.after_s)
        self.record.frames_dropped += due.dropped
        is_last = self._operator.stop_requested or self._why_over() is not None
        if is_last and self._pilot.should_end():
            return
        self._pilot.live_through(due.after_s)

    def _let_the_operator_think(self, interval_s: float) -> None:
        """Counted time does not run away while somebody thinks: a frame takes as long as it says."""
        until_s = time.perf_counter() + interval_s
        while time.perf_counter() < until_s and not self._stop_pending() and not self._operator.has_news:
            time.sleep(_POLL_S)

    def _stop_pending(self) -> bool:
        """Polled between iterations: a STOP never waits for a frame. The rest waits for the frame's end."""
        self._operator.listen()
        return self._operator.stop_requested

    def _obey_commands(self) -> None:
        operator = self._operator
        operator.listen()
        self._take_directives()
        if not operator.pause_requested or operator.wants_an_end:
            return
        self._hold("the operator lets it go on")
        self._announce(MissionPhase.PAUSED, "paused by command")
        with self._clock.paused():
            while operator.pause_requested and not operator.wants_an_end:
                time.sleep(_POLL_S)
                operator.listen()
                self._take_directives()
        if not operator.wants_an_end:
            resumed = "resumed by command"
            awaits = self._pilot.awaits
            self._announce(self._pilot.phase, f"{resumed}; {awaits}" if awaits is not None else resumed)

    def _wait_until_possible(self) -> None:
        """Stand still as long as there is a reason to; STOP and SUSPEND get through."""
        reason = self._why_wait()
        if reason is None:
            return
        self._hold("what it waited for is there")
        self._announce(MissionPhase.PAUSED, reason)
        with self._clock.paused():
            while self._why_wait() is not None and not self._operator.wants_an_end:
                time.sleep(_WAIT_POLL_S)
                self._operator.listen()
        if not self._operator.wants_an_end:
            self._announce(self._pilot.phase, "going on: what it waited for is there")

    def _hold(self, why_on: str) -> None:
        """A robot that lives on must stand while the mission waits; one that stands still with mission time
        drives on afterwards as if nothing had been."""
        if self._clock.world_goes_on:
            self._pilot.hold(why_on)

    def _take_directives(self) -> None:
        directives = self._operator.take_directives()
        if directives is not None:
            self._pilot.obey(directives)

    def _announce(self, phase: MissionPhase, reason: str) -> None:
        self._observer.on_event(PhaseChanged(time_s=self.time_s, phase=phase, reason=reason))

    def _report_progress(self, frame: Frame, report: IntegrationReport) -> None:
        state, voxels = self._robot.state, self._mapper.voxels
        self._observer.on_event(
            Telemetry(
                time_s=state.timestamp_s,
                frame=frame.sequence,
                x_m=state.x_m,
                y_m=state.y_m,
                yaw_rad=state.yaw_rad,
                path_length_m=state.path_length_m,
                collisions=state.collisions,
                n_gaussians=self._mapper.gaussians.size,
                n_keyframes=len(self._mapper.keyframes),
                observed_volume_m3=voxels.n_observed * voxels.config.size_m**3,
                missing_volume_m3=self._pilot.missing_volume_m3,
                psnr_current_db=report.psnr_predicted_db,
                mapping_s=self.record.mapping_s[-1],
                iterations=self.record.iterations,
                frames_dropped=self.record.frames_dropped,
                frames_thinned=self.record.frames_thinned,
                wall_s=self.wall_s,
            )
        )

    def _show(self, frame: Frame) -> None:
        if self._observer.wants_view():
            self._observer.on_view(self._view(frame))

    def _view(self, frame: Frame) -> MissionView:
        half = frame.intrinsics.scaled(0.5)
        rendered = render(self._mapper.gaussians, half, frame.T_world_camera)
        return MissionView(
            time_s=self.time_s,
            snapshot=self._mapper.snapshot(),
            robot=self._robot.state,
            plan=self._pilot.plan,
            insight=self._insight(),
            directives=self._pilot.directives,
            frame=frame,
            trajectory_m=self._trajectory(),
            rendered_rgb=rgb_to_uint8(rendered.colour),
            rendered_depth_m=rendered.depth_m,
        )

    def _insight(self) -> Insight | None:
        if not isinstance(self._planner, Insightful):
            return None
        return self._planner.insight(self._mapper.snapshot(), self._pilot.plan)

    def _trajectory(self) -> Float32[ndarray, "n 3"]:
        return np.array([pose.translation for pose in self.record.poses], np.float32).reshape(-1, 3)

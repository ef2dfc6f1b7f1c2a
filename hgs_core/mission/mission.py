"""The loop: sense, map, plan, move."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from hgs_core.gaussians.render import render
from hgs_core.mapping.mapper import IntegrationReport, Mapper
from hgs_core.mission.clock import Clock, ClockKind
from hgs_core.mission.config import MissionLimits
from hgs_core.mission.events import (
    Command,
    CommandSource,
    Halted,
    MissionEnded,
    MissionObserver,
    MissionPhase,
    MissionView,
    PhaseChanged,
    PlanMade,
    PromptCommands,
    StopReason,
    Telemetry,
    rgb_to_uint8,
)
from hgs_core.mission.record import MissionRecord
from hgs_core.planning.plan import NothingLeft, Plan, Planner, UnseenReason, UnseenRegion
from hgs_core.robot.path import Path
from hgs_core.robot.robot import Robot
from hgs_core.sensing.frame import Frame, Scan
from hgs_core.sensing.sensor import Scanner, Sensor

_PAUSE_POLL_S = 0.05


class Mission:
    """Drives one robot until nothing worth seeing is left.

    The loop is the same whether `robot`, `sensor` and `scanner` are simulated or real, and by either clock;
    the planner sees the maps and the robot's state, never what lies behind the sensors.
    """

    def __init__(
        self,
        *,
        robot: Robot,
        sensor: Sensor,
        scanner: Scanner,
        mapper: Mapper,
        planner: Planner,
        planner_rng: np.random.Generator,
        limits: MissionLimits,
        clock: Clock,
        observer: MissionObserver,
        commands: CommandSource,
    ) -> None:
        self.record = MissionRecord()
        self._robot = robot
        self._sensor = sensor
        self._scanner = scanner
        self._mapper = mapper
        self._planner = planner
        self._planner_rng = planner_rng
        self._limits = limits
        self._clock = clock
        self._observer = observer
        self._commands = commands
        self._plan: Plan | None = None
        self._began = False
        self._stop_requested = False
        self._pause_requested = False
        self._suspend_requested = False
        self._idle_plans = 0
        self._missing_volume_m3 = 0.0
        self._pose_at_plan = (np.inf, np.inf, np.inf)
        self._began_s = time.perf_counter()
        self._steering = threading.Lock()
        self._halted = False
        if isinstance(commands, PromptCommands):
            commands.on_stop(self.halt)

    def run(self, *, between_frames: Callable[[], None] = lambda: None) -> MissionRecord:
        """Explore until done, from the start or from what was restored. Returns the record; one without a
        `stop_reason` is that of a mission that was suspended. Raises only `HgsError`s of the parts.

        `between_frames` is called whenever `state` may be taken.
        """
        self._begin()
        while self.record.stop_reason is None:
            self.step()
            if self.record.stop_reason is None:
                between_frames()
                if self._suspend_requested and not self._stop_requested:
                    return self.record
        self._mapper.prune()
        self._observer.on_event(
            MissionEnded(
                time_s=self._time_s, stop_reason=self.record.stop_reason, message=self.record.message
            )
        )
        return self.record

    def step(self) -> None:
        """One frame: sense, map, plan, learn from frames until the next is due, move."""
        scan, frame = self._sense()
        report = self._integrate(scan, frame)
        self._obey_commands()
        if not self._should_end():
            self._plan_if_needed()
        self._show(frame)
        self._optimise()
        self._report_progress(frame, report)
        if self.record.stop_reason is None:
            self._go_on_to_next_frame()

    def halt(self) -> None:
        """Let the robot stand, for good. From any thread: what the loop is busy with (a frame that is taken
        in, a plan that is made) is not waited for, and nothing that it does afterwards moves the robot.
        """
        with self._steering:
            self._halted = True
            self._robot.stop()
            state = self._robot.state
        self._observer.on_event(
            Halted(
                time_s=state.timestamp_s,
                at_s=time.time(),
                x_m=state.x_m,
                y_m=state.y_m,
                yaw_rad=state.yaw_rad,
            )
        )

    def state(self) -> dict[str, Any]:
        """Everything that later frames and the report depend on, but what lies behind the seams `Robot`,
        `Sensor` and `Scanner`; to be taken between two frames (see `GaussianMap.state`).
        """
        return {
            "mapper": self._mapper.state(),
            "planner": self._planner.state(),
            "planner_rng": self._planner_rng.bit_generator.state,
            "plan": None if self._plan is None else self._plan.state(),
            "clock": self._clock.state(),
            "record": self.record.state(),
            "idle_plans": self._idle_plans,
            "missing_volume_m3": self._missing_volume_m3,
            "pose_at_plan": list(self._pose_at_plan),
            "wall_s": self._wall_s,
        }

    def restore(self, state: dict[str, Any], *, keyframe_folder: FilePath) -> None:
        """Go on from `state`, in the place where it was taken; keyframes' images lie in `keyframe_folder`."""
        self._mapper.restore(state["mapper"], keyframe_folder=keyframe_folder)
        self._planner.restore(state["planner"])
        self._planner_rng.bit_generator.state = state["planner_rng"]
        self._plan = None if state["plan"] is None else Plan.restore(state["plan"])
        self._clock.restore(state["clock"])
        self.record = MissionRecord.restore(state["record"])
        self._idle_plans = int(state["idle_plans"])
        self._missing_volume_m3 = float(state["missing_volume_m3"])
        x_m, y_m, yaw_rad = state["pose_at_plan"]
        self._pose_at_plan = (x_m, y_m, yaw_rad)
        self._began_s = time.perf_counter() - state["wall_s"]
        self._began = True

    @property
    def _time_s(self) -> float:
        return self._robot.state.timestamp_s

    @property
    def _wall_s(self) -> float:
        return time.perf_counter() - self._began_s

    def _begin(self) -> None:
        if self._began:
            self._announce(MissionPhase.RUNNING, f"going on from {self._time_s:.1f} s")
            return
        self._began = True
        self._announce(MissionPhase.RUNNING, "looking around")
        self._follow(self._first_look())

    def _first_look(self) -> Path:
        """A full turn on the spot: a level camera knows nothing of what is behind it."""
        state = self._robot.state
        turns = state.yaw_rad + np.radians([120.0, 240.0, 360.0])
        here = np.tile([state.x_m, state.y_m], (len(turns), 1))
        return Path(positions_m=here, yaws_rad=turns)

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
        self.record.frames_thinned += report.thinned
        self.record.poses.append(frame.T_world_camera)
        self.record.timestamps_s.append(frame.timestamp_s)
        return report

    def _optimise(self) -> None:
        if self.record.stop_reason is not None:
            return
        began = time.perf_counter()
        self.record.iterations += self._mapper.optimise(
            interrupted=self._stop_pending, time_left=self._clock.time_left
        )
        self.record.mapping_s[-1] += time.perf_counter() - began

    def _go_on_to_next_frame(self) -> None:
        due = self._clock.next_frame(interrupted=self._stop_pending)
        if self._stop_requested and self._should_end():
            return
        self.record.frames_dropped += due.dropped
        self._live_through(due.after_s)

    def _follow(self, path: Path) -> None:
        with self._steering:
            if not self._halted:
                self._robot.follow(path)

    def _live_through(self, duration_s: float) -> None:
        """The robot goes on with what it does for so much mission time."""
        if duration_s > 0:
            with self._clock.stopped():
                self._robot.advance(duration_s)

    def _plan_if_needed(self) -> None:
        reason = self._why_plan()
        # By a real clock the robot has driven on while the frame that this was decided on was taken in.
        self._live_through(self._clock.elapsed_s(nominal_s=0.0))
        if reason is None:
            return
        self._robot.stop()
        answer = self._planner.plan(self._mapper.snapshot(), self._robot.state, self._planner_rng)
        self.record.planning.append(answer.times)
        self._missing_volume_m3 = self._missing_volume()
        if isinstance(answer, NothingLeft):
            self._end(StopReason.COMPLETE, answer.reason, answer.unseen)
            return
        self._note_progress()
        self._plan = answer
        self._live_through(self._clock.elapsed_s(nominal_s=self._limits.planning_time_s))
        # The robot waits at the view until a frame has seen what was to be seen there, and the next plan.
        self._follow(answer.path.to_first_view())
        self._report_plan(answer, reason)

    def _why_plan(self) -> str | None:
        if self._plan is None:
            return "first look finished" if self._robot.arrived else None
        passed = self._robot.waypoints_passed
        if np.isfinite(self._plan.path.yaws_rad[:passed]).any():
            return "viewpoint taken"
        if self._robot.arrived:
            return "arrived"
        return self._planner.should_replan(self._mapper.snapshot(), self._robot.state, self._plan, passed)

    def _should_end(self) -> bool:
        if self._stop_requested:
            self._end(StopReason.INTERRUPTED, "stopped by command", self._unseen())
        elif self._time_s >= self._limits.max_time_s:
            limit = f"time limit of {self._limits.max_time_s:.0f} s reached"
            self._end(StopReason.TIME_LIMIT, limit, self._unseen(UnseenReason.TIME_LIMIT))
        elif self._idle_plans >= self._limits.stuck_after_plans:
            stuck = f"{self._idle_plans} plans in a row without moving"
            self._end(StopReason.STUCK, stuck, self._unseen())
        return self.record.stop_reason is not None

    def _end(self, reason: StopReason, message: str, unseen: tuple[UnseenRegion, ...]) -> None:
        self._robot.stop()
        self.record.stop_reason = reason
        self.record.message = message
        self.record.unseen = unseen

    def _unseen(self, cut_short: UnseenReason = UnseenReason.INTERRUPTED) -> tuple[UnseenRegion, ...]:
        """What is unseen; regions still to be visited get `cut_short` as their reason."""
        regions = self._planner.unseen(self._mapper.snapshot(), self._robot.state)
        return tuple(
            replace(region, reason=cut_short) if region.reason is UnseenReason.INTERRUPTED else region
            for region in regions
        )

    def _note_progress(self) -> None:
        state = self._robot.state
        x, y, yaw = self._pose_at_plan
        turned = abs((state.yaw_rad - yaw + np.pi) % (2 * np.pi) - np.pi) if np.isfinite(yaw) else np.inf
        moved = np.hypot(state.x_m - x, state.y_m - y)
        self._idle_plans = self._idle_plans + 1 if moved < 0.05 and turned < np.radians(5) else 0
        self._pose_at_plan = (state.x_m, state.y_m, state.yaw_rad)

    def _stop_pending(self) -> bool:
        """Polled between iterations: a STOP never waits for a frame. A pause waits for the frame's end."""
        self._take_commands()
        return self._stop_requested

    def _obey_commands(self) -> None:
        self._take_commands()
        if not self._pause_requested or self._stop_requested or self._suspend_requested:
            return
        self._announce(MissionPhase.PAUSED, "paused by command")
        with self._clock.stopped():
            while self._pause_requested and not (self._stop_requested or self._suspend_requested):
                time.sleep(_PAUSE_POLL_S)
                self._take_commands()
        if not (self._stop_requested or self._suspend_requested):
            self._announce(MissionPhase.RUNNING, "resumed by command")

    def _take_commands(self) -> None:
        while (command := self._commands.poll()) is not None:
            self._stop_requested |= command is Command.STOP
            self._suspend_requested |= command is Command.SUSPEND
            self._pause_requested = command is Command.PAUSE

    def _announce(self, phase: MissionPhase, reason: str) -> None:
        self._observer.on_event(PhaseChanged(time_s=self._time_s, phase=phase, reason=reason))

    def _missing_volume(self) -> float:
        voxels = self._mapper.voxels
        return voxels.n_missing * voxels.config.size_m**3

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
                missing_volume_m3=self._missing_volume_m3,
                psnr_current_db=report.psnr_predicted_db,
                mapping_s=self.record.mapping_s[-1],
                iterations=self.record.iterations,
                frames_dropped=self.record.frames_dropped,
                frames_thinned=self.record.frames_thinned,
                wall_s=self._wall_s,
            )
        )

    def _show(self, frame: Frame) -> None:
        if self._observer.wants_view():
            self._observer.on_view(self._view(frame))

    def _view(self, frame: Frame) -> MissionView:
        half = frame.intrinsics.scaled(0.5)
        rendered = render(self._mapper.gaussians, half, frame.T_world_camera)
        return MissionView(
            time_s=self._time_s,
            snapshot=self._mapper.snapshot(),
            robot=self._robot.state,
            plan=self._plan,
            frame=frame,
            trajectory_m=self._trajectory(),
            rendered_rgb=rgb_to_uint8(rendered.colour),
            rendered_depth_m=rendered.depth_m,
        )

    def _trajectory(self) -> Float32[ndarray, "n 3"]:
        return np.array([pose.translation for pose in self.record.poses], np.float32).reshape(-1, 3)

    def _report_plan(self, plan: Plan, why: str) -> None:
        selected = [c for c in plan.candidates if c.status == "selected"]
        self._observer.on_event(
            PlanMade(
                time_s=self._time_s,
                reason=f"{why}: {plan.reason}",
                n_candidates=len(plan.candidates),
                n_selected=len(selected),
                n_reconstructing=sum(s.state == "reconstructing" for s in plan.subspaces),
                path_length_m=plan.path.length_m,
                observed_share=plan.observed_share,
                planning_s=plan.times.total_s,
                viewpoint_evaluation_s=plan.times.viewpoint_evaluation_s,
                local_s=plan.times.local_s,
                global_s=plan.times.global_s,
                candidates=tuple(_candidate_json(c) for c in plan.candidates),
                coverage_unit=plan.coverage_unit,
            )
        )


def _candidate_json(candidate: Any) -> dict[str, Any]:
    return {
        "x_m": round(candidate.x_m, 3),
        "y_m": round(candidate.y_m, 3),
        "yaw_rad": round(candidate.yaw_rad, 4),
        "coverage": round(candidate.coverage_gain, 5),
        "quality": round(candidate.quality_gain, 5),
        "total": round(candidate.total_gain, 5),
        "status": str(candidate.status),
    }

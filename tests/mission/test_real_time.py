"""The loop by a real clock, in made-up time: what is late is dropped, and nothing waits in line."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hgs_core.geometry.boxes import Box
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.config import MappingConfig
from hgs_core.mapping.mapper import IntegrationReport, Mapper
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.mission.clock import LockstepClock, RealClock
from hgs_core.mission.commands import Command
from hgs_core.mission.config import MissionLimits
from hgs_core.mission.events import MissionEvent, MissionView, StopReason, Telemetry
from hgs_core.mission.mission import Mission
from hgs_core.mission.record import MissionRecord
from hgs_core.planning.config import HierarchicalConfig
from hgs_core.planning.directives import Directives
from hgs_core.planning.navigator import Navigator
from hgs_core.planning.plan import NothingLeft, Plan, PlanningTimes, UnseenRegion
from hgs_core.robot.differential import Differential, DifferentialConfig
from hgs_core.robot.path import Path as RobotPath
from hgs_core.robot.robot import RobotState
from hgs_core.sensing.frame import Frame, Scan
from hgs_core.voxels.voxel_map import VoxelConfig
from tests.mission.passing_time import PassingTime

INTERVAL_S = 0.4
CAMERA = CameraIntrinsics.centred(60, 40, 30.0)


class TurningRobot:
    """Turns at a steady rate and never arrives."""

    def __init__(self, rate_radps: float) -> None:
        self._rate_radps = rate_radps
        self._time_s = 0.0
        self._yaw_rad = 0.0
        self._moves = False

    @property
    def state(self) -> RobotState:
        return RobotState(
            x_m=0.0,
            y_m=0.0,
            yaw_rad=self._yaw_rad,
            timestamp_s=self._time_s,
            path_length_m=0.0,
            collisions=0,
        )

    @property
    def arrived(self) -> bool:
        return False

    @property
    def waypoints_passed(self) -> int:
        return 0

    def follow(self, path: RobotPath) -> None:
        self._moves = True

    def advance(self, duration_s: float) -> RobotState:
        self._time_s += duration_s
        self._yaw_rad += self._rate_radps * duration_s * self._moves
        return self.state

    def stop(self) -> None:
        self._moves = False

    def limit_speed(self, max_speed_mps: float | None) -> None:
        raise AssertionError("nobody asks for a limit")

    @property
    def standing_in_s(self) -> float:
        return 0.0


class RobotAtViews(TurningRobot):
    """Is always where it should be: a plan is wanted with every frame."""

    @property
    def arrived(self) -> bool:
        return True


class SlowSensors:
    """Sees a smoothly coloured wall; delivering takes `cost_s` of the simulator's time."""

    def __init__(self, robot: TurningRobot, time: PassingTime, cost_s: float) -> None:
        self._robot = robot
        self._time = time
        self._cost_s = cost_s
        self._sequence = 0

    def capture(self) -> Frame:
        self._time.sleep(self._cost_s)
        state = self._robot.state
        pose = level_camera_pose(0.0, 0.0, 1.0, state.yaw_rad)
        rays = CAMERA.rays() @ pose.rotation.T
        rays /= np.linalg.norm(rays, axis=2, keepdims=True)
        self._sequence += 1
        return Frame(
            rgb=(127.5 + 100.0 * rays).astype(np.uint8),
            depth_m=np.full((40, 60), 2.0, np.float32),
            intrinsics=CAMERA,
            T_world_camera=pose,
            timestamp_s=state.timestamp_s,
            sequence=self._sequence - 1,
        )

    def scan(self) -> Scan:
        self._time.sleep(self._cost_s)
        bearings = np.arange(8) * (np.pi / 4)
        return Scan(
            origin_m=np.array([0.0, 0.0, 0.15]),
            bearings_rad=bearings,
            ranges_m=np.full(8, 2.0, np.float32),
            timestamp_s=self._robot.state.timestamp_s,
        )


class SlowMapper(Mapper):
    """Integration and every optimisation step take so much time."""

    def __init__(self, folder: Path, time: PassingTime, *, integration_s: float, step_s: float) -> None:
        super().__init__(
            MappingConfig(),
            VoxelConfig(),
            camera_range_m=5.0,
            scanner_range_m=5.0,
            region=None,
            keyframe_folder=folder,
            rng=np.random.default_rng(0),
        )
        self.steps: list[int] = []
        self._time = time
        self._integration_s = integration_s
        self._step_s = step_s

    def integrate(self, frame: Frame, *, may_thin: bool = False) -> IntegrationReport:
        self._time.sleep(self._integration_s)
        return super().integrate(frame, may_thin=may_thin)

    def optimise(
        self, *, interrupted: Callable[[], bool], time_left: Callable[[], bool] | None = None
    ) -> int:
        def left() -> bool:
            """Asked when a step is over: that is when its time has passed."""
            assert time_left is not None
            self._time.sleep(self._step_s)
            return time_left()

        taken = super().optimise(interrupted=interrupted, time_left=left if time_left else None)
        self.steps.append(taken)
        return taken


class SlowPlanner:
    """Takes `cost_s` for a plan to stay where it is."""

    def __init__(self, time: PassingTime, cost_s: float) -> None:
        self._time = time
        self._cost_s = cost_s

    def plan(self, snapshot: MapSnapshot, state: RobotState, rng: np.random.Generator) -> Plan | NothingLeft:
        self._time.sleep(self._cost_s)
        return Plan(
            path=RobotPath(positions_m=np.zeros((1, 2)), yaws_rad=np.full(1, np.nan)),
            candidates=(),
            subspaces=(),
            global_tour_m=np.zeros((0, 3)),
            local_path_m=np.zeros((0, 3)),
            horizon=Box(lower_m=np.zeros(3), upper_m=np.ones(3)),
            observed_share=0.0,
            reason="a test",
            times=PlanningTimes(viewpoint_evaluation_s=self._cost_s, local_s=0.0, global_s=0.0),
        )

    def should_replan(
        self, snapshot: MapSnapshot, state: RobotState, plan: Plan, waypoints_passed: int
    ) -> str | None:
        return None

    def obey(self, directives: Directives, start_xy_m: np.ndarray) -> None:
        raise AssertionError("nobody asks for anything")

    def refuse(self, snapshot: MapSnapshot, x_m: float, y_m: float, yaw_rad: float) -> None:
        raise AssertionError("nobody refuses a view")

    def adopt(self, snapshot: MapSnapshot, robot: RobotState, plan: Plan) -> None:
        raise AssertionError("nobody asks for another plan")

    def unseen(self, snapshot: MapSnapshot, state: RobotState) -> tuple[UnseenRegion, ...]:
        return ()

    def state(self) -> dict[str, Any]:
        return {}

    def restore(self, state: dict[str, Any]) -> None:
        raise AssertionError("no mission is resumed here")


class Heard:
    def __init__(self) -> None:
        self.telemetry: list[Telemetry] = []

    def on_event(self, event: MissionEvent) -> None:
        if isinstance(event, Telemetry):
            self.telemetry.append(event)

    def wants_view(self) -> bool:
        return False

    def on_view(self, view: MissionView) -> None:
        raise AssertionError("no view was wanted")


class StopAfter:
    """STOP at a moment of the made-up time."""

    def __init__(self, time: PassingTime, at_s: float) -> None:
        self._time = time
        self._at_s = time.began_s + at_s
        self._given = False

    def poll(self) -> Command | None:
        if self._given or self._time.now() < self._at_s:
            return None
        self._given = True
        return Command.STOP


class Trial:
    """One short mission; costs in seconds of the made-up time."""

    def __init__(
        self,
        folder: Path,
        *,
        integration_s: float = 0.1,
        step_s: float = 0.025,
        planning_s: float | None = None,
        simulator_s: float = 0.0,
        rate_radps: float = 1.0,
        max_time_s: float = 4.0,
        stop_at_s: float = np.inf,
        real: bool = True,
    ) -> None:
        self.time = PassingTime()
        robot = TurningRobot(rate_radps) if planning_s is None else RobotAtViews(rate_radps)
        sensors = SlowSensors(robot, self.time, simulator_s)
        self.mapper = SlowMapper(folder, self.time, integration_s=integration_s, step_s=step_s)
        self.heard = Heard()
        self.mission = Mission(
            robot=robot,
            vehicle=Differential(DifferentialConfig()),
            sensor=sensors,
            scanner=sensors,
            mapper=self.mapper,
            planner=SlowPlanner(self.time, planning_s or 0.0),
            planner_rng=np.random.default_rng(0),
            limits=MissionLimits(max_time_s=max_time_s, stuck_after_plans=1000),
            clock=RealClock(INTERVAL_S, now=self.time.now, sleep=self.time.sleep)
            if real
            else LockstepClock(INTERVAL_S),
            observer=self.heard,
            commands=StopAfter(self.time, stop_at_s),
            navigator=Navigator(HierarchicalConfig(), DifferentialConfig()),
            directives=Directives(),
        )
        self.record: MissionRecord = self.mission.run()


def test_who_keeps_up_takes_every_frame_and_steps_until_shortly_before_the_next(tmp_path: Path) -> None:
    trial = Trial(tmp_path)
    np.testing.assert_allclose(trial.record.timestamps_s, np.arange(11) * INTERVAL_S, atol=1e-9)
    assert trial.record.frames_dropped == 0
    # 0.36 s until the idle share begins, 0.1 s of them for the frame: the eleventh step begins at 0.35 s.
    assert trial.mapper.steps == [11] * 10
    assert trial.record.iterations == 110


def test_the_simulator_takes_no_time_from_the_mission(tmp_path: Path) -> None:
    slow, quick = Trial(tmp_path / "a", simulator_s=3.0), Trial(tmp_path / "b")
    np.testing.assert_allclose(slow.record.timestamps_s, quick.record.timestamps_s, atol=1e-6)
    assert slow.mapper.steps == quick.mapper.steps


def test_a_mapper_too_slow_for_the_camera_drops_frames_and_lets_none_wait(tmp_path: Path) -> None:
    trial = Trial(tmp_path, integration_s=0.975, max_time_s=10.0)
    taken = np.array(trial.record.timestamps_s)
    # 2.5 frames fall due while one is taken in, and each gets its one step all the same.
    assert np.diff(taken).mean() == pytest.approx(1.0, abs=0.05)
    assert trial.mapper.steps == [1] * (len(taken) - 1)
    last = round(taken[-1] / INTERVAL_S)
    assert len(taken) + trial.record.frames_dropped == last + 1
    # However long it goes on, the frame in hand is never older than one that has just been missed.
    for number, frame_s in enumerate(taken[1:], start=1):
        begun_s = number * 1.0
        assert 0.0 <= begun_s - frame_s < INTERVAL_S + 1e-6


def test_planning_costs_what_it_takes_and_the_robot_stands_meanwhile(tmp_path: Path) -> None:
    trial = Trial(tmp_path, planning_s=1.0, integration_s=0.0, step_s=0.0, max_time_s=10.0)
    taken = np.array(trial.record.timestamps_s)
    # A plan ends at 1.0 s: the frame that was due at 0.8 is taken then, that of 0.4 is lost, and so forth.
    np.testing.assert_allclose(taken, np.arange(11.0), atol=1e-6)
    assert trial.record.frames_dropped == 15  # of 26 that fell due
    yaws = [pose.rotation for pose in trial.record.poses]
    np.testing.assert_allclose(yaws[1:], yaws[1:2] * 10, atol=1e-6)


def test_frames_of_a_standing_camera_are_thinned_and_their_time_goes_to_replay(tmp_path: Path) -> None:
    trial = Trial(tmp_path, rate_radps=0.0, max_time_s=4.0)
    assert trial.record.frames_thinned > 5
    assert len(trial.record.poses) == 11
    assert trial.mapper.steps == [11] * 10
    assert trial.heard.telemetry[-1].frames_thinned == trial.record.frames_thinned


def test_lockstep_learns_every_frame_and_counts_its_steps(tmp_path: Path) -> None:
    trial = Trial(tmp_path, rate_radps=0.0, integration_s=7.0, real=False, max_time_s=3.9)
    assert trial.record.frames_thinned == 0
    assert trial.record.frames_dropped == 0
    assert trial.mapper.steps == [0] + [10] * 9
    np.testing.assert_allclose(trial.record.timestamps_s, np.arange(11) * INTERVAL_S, atol=1e-9)


@pytest.mark.parametrize(
    ("stop_at_s", "step_s", "latest_s"),
    [
        (2.15, 0.025, 2.175),  # between two steps
        (2.15, 1.0, 3.1),  # the step that was under way is finished
        (2.38, 0.025, 2.4),  # waiting for the frame that is due at 2.4: not for its coming
    ],
)
def test_stop_waits_for_no_frame(stop_at_s: float, step_s: float, latest_s: float, tmp_path: Path) -> None:
    trial = Trial(tmp_path, step_s=step_s, stop_at_s=stop_at_s, max_time_s=60.0)
    assert trial.record.stop_reason is StopReason.INTERRUPTED
    assert trial.time.now() - trial.time.began_s <= latest_s + 1e-6
    assert trial.record.timestamps_s[-1] <= 2.0 + 1e-6
    assert len(trial.heard.telemetry) == len(trial.record.poses)

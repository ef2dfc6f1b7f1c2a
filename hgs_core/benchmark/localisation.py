"""`hgs bench localisation`: how far a method of localisation is off along a known path."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from pydantic import BaseModel, ConfigDict

from hgs_core.benchmark.localised_maps import LocalisedMaps, localised_maps
from hgs_core.errors import ConfigError, StreamError
from hgs_core.evaluation.trajectory import Trajectory, read_trajectory
from hgs_core.evaluation.trajectory_error import (
    FEWEST_POSES,
    Alignment,
    TrajectoryError,
    trajectory_error,
)
from hgs_core.geometry.se3 import SE3
from hgs_core.localisation.lidar_odometry import LidarOdometryConfig
from hgs_core.localisation.localiser import LocalisationConfig, Lost
from hgs_core.localisation.methods import build_localiser
from hgs_core.mission.config import resolve_mission_config
from hgs_core.mission.finished_run import FinishedRun
from hgs_core.sensing.depth_camera import with_uniform_noise
from hgs_core.sensing.lidar import LidarConfig
from hgs_core.sensing.point_scan import PointScan
from hgs_core.sensing.raw_frame import AlignedFrame
from hgs_core.sensing.recording import open_recording
from hgs_core.sensing.rectifier import Rectifier
from hgs_core.sensing.ros.poses import StampedPoses
from hgs_core.sensing.ros.topics import TopicOptions
from hgs_core.simulation.lidar import SimulatedLidar

TRAJECTORY: Final = "trajectory.txt"
_PRESET: Final = "paper"
"""Any would do: its localisation section has nothing but what is set here."""
_NOISE_SEED: Final = 0
_GAP_S: Final = 1.0


class LocalisationBenchmark(BaseModel):
    """A method's errors along one path."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    source: str
    """Name of the recording's or the run's folder."""
    method: str
    frames: int
    lost: int
    """Frames that got no pose."""
    first_reason: str | None
    """Why the first of them did not."""
    processor_s_per_frame: float
    """Processor time of the method alone, of all threads, scans included."""
    umeyama: TrajectoryError
    first_pose: TrajectoryError
    maps: LocalisedMaps | None = None
    """What the errors cost the map; None where no maps were made."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Stream:
    """Frames with their true poses, and the scans that come with them."""

    name: str
    n_frames: int
    start: SE3
    """The camera's true pose when the first frame, or scan, is taken."""
    items: Callable[[], Iterator[AlignedFrame | PointScan]]
    """The same ones whenever it is called."""
    run: FinishedRun | None = None
    """Whose path it is, if a run's."""


def localisation_settings(method: str, overrides: dict[str, str]) -> LocalisationConfig:
    """A method's settings, with `key.sub=value` changes to its defaults.

    Raises `ConfigError` for an unknown method or a wrong setting.
    """
    within = {f"localisation.{key}": value for key, value in overrides.items()}
    return resolve_mission_config(_PRESET, {"localisation.method": method, **within}).localisation


def run_localisation_benchmark(
    source: Path,
    config: LocalisationConfig,
    *,
    interval_s: float,
    topics: TopicOptions | None = None,
    with_maps: bool = False,
    progress: Callable[[str], None] = lambda message: None,
) -> LocalisationBenchmark:
    """Localise along a recording (TUM folder or MCAP file), or along the path of a finished run.

    A recording is taken as it is. The path of a run is driven again, with a frame every `interval_s` by that
    run's camera and, for `lidar-odometry`, with a VLP-16 above it. Poses are taken from the frames before
    the method sees them (but for `given`). Raises `StreamError` for a recording that cannot be read or has
    no poses, or when too few frames are located, and `ConfigError` for a folder that is neither, or for
    `with_maps` of a recording: its true surface is not known.
    """
    stream = _stream(source, config, interval_s, topics)
    if with_maps and stream.run is None:
        raise ConfigError(
            f"{source} is no folder that `hgs run` left behind: maps are compared with a true scene, which "
            "a recording has not; leave --maps out"
        )
    located: list[tuple[float, SE3]] = []
    true: list[tuple[float, SE3]] = []
    reasons: list[str] = []
    localiser, busy_s = build_localiser(config, start=stream.start), 0.0
    for item in stream.items():
        if isinstance(item, PointScan):
            began = time.process_time()
            localiser.take_scan(item)
            busy_s += time.process_time() - began
            continue
        pose = item.T_world_camera
        if pose is None:
            continue
        shown = item if config.method == "given" else replace(item, T_world_camera=None)
        began = time.process_time()
        answer = localiser.locate(shown)
        busy_s += time.process_time() - began
        true.append((item.timestamp_s, pose))
        if isinstance(answer, Lost):
            reasons.append(answer.reason)
        else:
            located.append((item.timestamp_s, answer.T_world_camera))
        if len(true) % 10 == 0:
            progress(f"frame {len(true)} of {stream.n_frames}")
    if len(located) < FEWEST_POSES:
        why = reasons[0] if reasons else f"{len(true)} frames have a pose to compare with"
        raise StreamError(f"{stream.name}: {len(located)} frames were located; {why}")
    estimate, truth = _trajectory(located), _trajectory(true)
    maps = None
    if with_maps and stream.run is not None:
        maps = localised_maps(stream.run, stream.items(), truth, estimate, progress)
    return LocalisationBenchmark(
        source=stream.name,
        method=config.method,
        frames=len(true),
        lost=len(reasons),
        first_reason=reasons[0] if reasons else None,
        processor_s_per_frame=busy_s / len(true),
        umeyama=trajectory_error(estimate, truth, alignment=Alignment.UMEYAMA),
        first_pose=trajectory_error(estimate, truth, alignment=Alignment.FIRST_POSE),
        maps=maps,
    )


def _stream(
    source: Path, config: LocalisationConfig, interval_s: float, topics: TopicOptions | None
) -> _Stream:
    if FinishedRun.is_described(source):
        return _driven(source, config, interval_s)
    if isinstance(config, LidarOdometryConfig):
        raise ConfigError(
            f"{source} is no folder that `hgs run` left behind: a lidar is simulated along a run's path alone"
        )
    recording, rectifier = open_recording(source, topics), Rectifier()
    start = next((raw.T_world_camera for raw in recording if raw.T_world_camera is not None), None)
    if start is None:
        raise StreamError(f"{source}: nothing to compare with: {recording.pose_origin}")
    return _Stream(
        name=recording.name,
        n_frames=int(recording.is_posed.sum()),
        start=start,
        items=lambda: (rectifier.rectify(raw) for raw in recording),
    )


def _driven(folder: Path, config: LocalisationConfig, interval_s: float) -> _Stream:
    """The frames and scans along a run's path; both start with the run, scans first."""
    if not interval_s > 0:
        raise ConfigError(f"--interval {interval_s}: must be above 0 s")
    run, recorded = FinishedRun.open(folder), read_trajectory(folder / TRAJECTORY)
    if len(recorded) < FEWEST_POSES:
        raise StreamError(f"{folder / TRAJECTORY} has {len(recorded)} poses: nothing to drive along")
    stamped = [(float(t), recorded.poses[k]) for k, t in enumerate(recorded.timestamps_s)]
    path = StampedPoses(stamped, offset_s=1e-6, gap_s=_GAP_S)
    begin_s, end_s = stamped[0][0], stamped[-1][0]
    frame_times = np.arange(begin_s, end_s, interval_s)
    return _Stream(
        name=folder.name,
        n_frames=len(frame_times),
        start=stamped[0][1],
        items=lambda: _rendered(run, path, frame_times, end_s, config),
        run=run,
    )


def _rendered(
    run: FinishedRun,
    path: StampedPoses,
    frame_times: np.ndarray,
    end_s: float,
    config: LocalisationConfig,
) -> Iterator[AlignedFrame | PointScan]:
    caster, camera = run.open_scene().caster, run.config.sensor.camera
    camera_rng, lidar_rng = (
        np.random.default_rng(seed) for seed in np.random.SeedSequence(_NOISE_SEED).spawn(2)
    )
    scans: list[float] = []
    if isinstance(config, LidarOdometryConfig):
        lidar_config = LidarConfig()
        lidar = SimulatedLidar(caster, lidar_config, lidar_rng)
        T_camera_lidar = config.T_lidar_camera().inverse()
        scans = list(np.arange(float(frame_times[0]), end_s, lidar_config.interval_s))
    for sequence, time_s in enumerate(frame_times):
        pose = path.at(float(time_s))
        if pose is None:
            continue  # more than a second without a frame: where it was meanwhile is not recorded
        rgb, depth_m = caster.render(camera.intrinsics(), pose, camera.range_m)
        frame = AlignedFrame(
            rgb=rgb,
            depth_m=with_uniform_noise(depth_m, camera.depth_noise_m, camera_rng),
            intrinsics=camera.intrinsics(),
            T_world_camera=pose,
            timestamp_s=float(time_s),
            sequence=sequence,
        )
        while scans and scans[0] <= time_s + 1e-9:
            scan_s = scans.pop(0)
            T_world_camera = path.at(scan_s)
            if T_world_camera is not None:
                yield lidar.scan(T_world_camera @ T_camera_lidar, scan_s)
        yield frame


def _trajectory(stamped: list[tuple[float, SE3]]) -> Trajectory:
    return Trajectory(
        timestamps_s=np.array([time_s for time_s, _ in stamped]),
        poses=SE3(
            rotation=np.array([pose.rotation for _, pose in stamped]),
            translation=np.array([pose.translation for _, pose in stamped]),
        ),
    )

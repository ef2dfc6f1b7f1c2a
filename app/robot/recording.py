"""Frames rendered beforehand along a recorded path, as they will be sent: no camera is quick enough to render
large ones live.

```text
recording.json      scene, camera, scanner's range, region, formats
trajectory.txt      T_world_camera of every frame, TUM layout; times from 0
frames/000000.jpg   colour; beside it the depth, .png or .zst
scans.npz           origin_m (n, 3), first_bearing_rad (n), ranges_m (n, n_rays)
```
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, Literal

import msgspec
import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial.transform import Rotation, Slerp

from app.robot.camera import scan_part
from app.robot.live_robot import facts_of
from hgs_core.errors import ConfigError, StreamError
from hgs_core.evaluation.trajectory import Trajectory, read_trajectory, write_trajectory
from hgs_core.geometry.se3 import SE3
from hgs_core.live.images import encoded_colour, encoded_depth
from hgs_core.live.messages import PROTOCOL, CameraFacts, Frame, Hello, ScanPart
from hgs_core.live.poses import numbers_of
from hgs_core.scene.scene import Scene
from hgs_core.sensing.depth_camera import DepthCameraConfig, with_uniform_noise
from hgs_core.sensing.frame import Scan
from hgs_core.sensing.scanner import ScannerConfig
from hgs_core.simulation.depth_holes import DepthHoles

_SUFFIXES: Final = {"png": "png", "zstd": "zst"}
_VERSION: Final = 1


class RecordingFacts(msgspec.Struct, kw_only=True, frozen=True, forbid_unknown_fields=True):
    """`recording.json`."""

    version: int = _VERSION
    scene: str
    camera: CameraFacts
    depth_format: Literal["png", "zstd"]
    scanner_range_m: float
    region_m: list[list[float]]
    n_frames: int


def record(
    scene: Scene,
    source: str,
    path: Trajectory,
    folder: Path,
    *,
    camera: DepthCameraConfig,
    scanner: ScannerConfig,
    region_m: list[list[float]],
    depth_format: str,
    holes: DepthHoles,
    rng: np.random.Generator,
    progress: Callable[[int, int], None],
) -> int:
    """Render a frame every `camera.frame_interval_s` of `path`; how many there are.

    `source` is the scene's name, kept for those who evaluate. Written whole or not at all. Raises
    `ConfigError` when `folder` is not absent or empty, and `StreamError` for a path of less than two poses.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigError(f"{folder} exists already: choose another folder or remove it first")
    poses = resampled(path, camera.frame_interval_s)
    partial = folder.with_name(f"{folder.name}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    (partial / "frames").mkdir(parents=True)
    intrinsics = camera.intrinsics()
    scans: list[ScanPart] = []
    for k in range(len(poses)):
        progress(k, len(poses))
        pose = poses.poses[k]
        rgb, depth = scene.caster.render(intrinsics, pose, camera.range_m)
        depth = holes.punched(with_uniform_noise(depth, camera.depth_noise_m, rng))
        stem = partial / "frames" / f"{k:06d}"
        stem.with_suffix(".jpg").write_bytes(encoded_colour(rgb))
        stem.with_suffix(f".{_SUFFIXES[depth_format]}").write_bytes(
            encoded_depth(depth, depth_format=depth_format)
        )
        scans.append(scan_part(_scan(scene, pose, scanner, rng)))
    np.savez_compressed(
        partial / "scans.npz",
        origin_m=np.array([scan.origin_m for scan in scans]),
        first_bearing_rad=np.array([scan.first_bearing_rad for scan in scans]),
        ranges_m=np.array([np.frombuffer(scan.ranges_m, "<f4") for scan in scans]),
    )
    write_trajectory(poses, partial / "trajectory.txt")
    facts = RecordingFacts(
        scene=source,
        camera=facts_of(camera),
        depth_format="zstd" if depth_format == "zstd" else "png",
        scanner_range_m=scanner.range_m,
        region_m=region_m,
        n_frames=len(poses),
    )
    (partial / "recording.json").write_bytes(msgspec.json.format(msgspec.json.encode(facts)) + b"\n")
    if folder.exists():
        folder.rmdir()
    partial.rename(folder)
    return len(poses)


def resampled(path: Trajectory, interval_s: float) -> Trajectory:
    """A pose every `interval_s`, from 0 to the path's end: positions linear, rotations along great arcs.

    Raises `StreamError` for less than two poses, or times that do not rise.
    """
    times = path.timestamps_s
    if len(times) < 2 or not bool(np.all(np.diff(times) > 0)):
        raise StreamError(f"a path needs two poses or more, at rising times; it has {len(times)}")
    wanted = np.arange(0.0, float(times[-1] - times[0]) + 1e-9, interval_s)
    at = np.minimum(times[0] + wanted, times[-1])
    positions = np.stack([np.interp(at, times, path.poses.translation[:, axis]) for axis in range(3)], axis=1)
    rotations = Slerp(times, Rotation.from_matrix(path.poses.rotation))(at).as_matrix()
    return Trajectory(timestamps_s=wanted, poses=SE3(rotation=rotations, translation=positions))


def _scan(scene: Scene, pose: SE3, scanner: ScannerConfig, rng: np.random.Generator) -> Scan:
    """One turn of the scanner below the camera."""
    x, y, _ = pose.translation.tolist()
    forward = pose.rotation[:, 2]
    yaw = math.atan2(forward[1], forward[0])
    bearings = yaw + np.arange(scanner.n_rays) * (2 * np.pi / scanner.n_rays)
    directions = np.stack([np.cos(bearings), np.sin(bearings), np.zeros_like(bearings)], axis=-1)
    origin = np.array([x, y, scanner.mount_height_m])
    ranges = scene.caster.cast(np.broadcast_to(origin, directions.shape), directions)
    ranges = np.where(ranges <= scanner.range_m, ranges, np.float32(np.inf))
    return Scan(
        origin_m=origin,
        bearings_rad=bearings,
        ranges_m=with_uniform_noise(ranges, scanner.noise_m, rng),
        timestamp_s=0.0,
    )


class FrameRecording:
    """A folder that `record` wrote, as `Playback`. Raises `StreamError` naming what is missing or damaged."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        try:
            content = (folder / "recording.json").read_bytes()
            self.facts = msgspec.json.decode(content, type=RecordingFacts)
            with np.load(folder / "scans.npz") as scans:
                self._scans: dict[str, Any] = {name: scans[name] for name in scans.files}
        except OSError as error:
            raise StreamError(f"{folder} is no recording of `hgs robot --record`: {error}") from error
        except (msgspec.DecodeError, ValueError) as error:
            raise StreamError(f"{folder}: recording.json or scans.npz is damaged: {error}") from error
        if self.facts.version != _VERSION:
            raise StreamError(f"{folder} has version {self.facts.version}; this version reads {_VERSION}")
        self.path = read_trajectory(folder / "trajectory.txt")
        expected = {"origin_m", "first_bearing_rad", "ranges_m"}
        if self._scans.keys() != expected or {len(array) for array in self._scans.values()} != {len(self)}:
            raise StreamError(
                f"{folder}: scans.npz does not hold {', '.join(sorted(expected))} of every frame"
            )
        if len(self) != self.facts.n_frames or len(self) == 0:
            raise StreamError(
                f"{folder}: trajectory.txt has {len(self)} poses for {self.facts.n_frames} frames"
            )

    def __len__(self) -> int:
        return len(self.path)

    @property
    def timestamps_s(self) -> Float[ndarray, " n_frames"]:
        return self.path.timestamps_s

    def hello(self, name: str) -> Hello:
        facts = self.facts
        return Hello(
            protocol=PROTOCOL,
            name=name,
            camera=facts.camera,
            robot=None,
            scanner_range_m=facts.scanner_range_m,
            region_m=facts.region_m,
        )

    def pose(self, index: int) -> SE3:
        return self.path.poses[index]

    def frame(self, index: int, time_s: float) -> Frame:
        """As it is sent, taken at `time_s` of the robot's clock."""
        stem = self._folder / "frames" / f"{index:06d}"
        ranges = self._scans["ranges_m"][index]
        try:
            colour = stem.with_suffix(".jpg").read_bytes()
            depth = stem.with_suffix(f".{_SUFFIXES[self.facts.depth_format]}").read_bytes()
        except OSError as error:
            raise StreamError(f"{self._folder}: frame {index} is missing: {error}") from error
        return Frame(
            sequence=index,
            time_s=time_s,
            pose=numbers_of(self.path.poses[index]),
            colour=colour,
            depth=depth,
            depth_format=self.facts.depth_format,
            scan=ScanPart(
                origin_m=self._scans["origin_m"][index].tolist(),
                first_bearing_rad=float(self._scans["first_bearing_rad"][index]),
                step_rad=2.0 * np.pi / len(ranges),
                ranges_m=ranges.astype("<f4").tobytes(),
            ),
        )

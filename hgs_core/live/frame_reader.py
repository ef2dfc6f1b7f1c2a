"""`FrameReader`: from a robot's messages to frames of one pinhole camera, at a pose that is believed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.errors import StreamError
from hgs_core.geometry.camera import level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.live.cameras import RobotCameras
from hgs_core.live.images import decoded_colour, decoded_depth
from hgs_core.live.messages import Cloud, Frame, Hello, Report, ScanPart
from hgs_core.live.poses import pose_of
from hgs_core.localisation.localiser import Localiser, Lost
from hgs_core.sensing import frame as sensing
from hgs_core.sensing.point_scan import PointScan
from hgs_core.sensing.raw_frame import RawFrame
from hgs_core.sensing.rectifier import Rectifier


@dataclass(frozen=True, kw_only=True, eq=False)
class LiveFrame:
    """A frame that has come, unpacked, with the scan and the report of its moment."""

    frame: sensing.Frame
    scan: sensing.Scan | None
    report: Report | None
    """The newest one that is not younger than the frame, by the robot's clock."""


class FrameReader:
    """Reads one robot's frames and clouds in their order, from hello to hello."""

    def __init__(
        self, localiser_from: Callable[[SE3], Localiser], *, located: Float[ndarray, "4 4"] | None
    ) -> None:
        """`localiser_from` makes a localiser that begins at a camera's pose; `located`: `T_world_camera` of
        the newest frame that an earlier process has located."""
        self.located = None if located is None else SE3.from_matrix(np.array(located))
        """`T_world_camera` of the newest frame that was located."""
        self._localiser_from = localiser_from
        self._rectifier = Rectifier()
        self._cameras: RobotCameras | None = None
        self._localiser: Localiser | None = None

    def begin(self, hello: Hello) -> None:
        """What comes from now on is of these cameras, and of a clock that begins anew. Raises `StreamError`
        for cameras that cannot be; nothing has changed then."""
        cameras = RobotCameras.of(hello)
        start = _camera_of(hello) if self.located is None else self.located
        localiser = self._localiser_from(start)
        self._cameras, self._localiser = cameras, localiser

    def read(self, frame: Frame, report: Report | None, *, time_s: float) -> LiveFrame:
        """The frame as taken at `time_s` of mission time. Raises `StreamError` for images that are none, and
        for a pose that is missing, cannot be, or is not found."""
        assert self._cameras is not None
        assert self._localiser is not None
        cameras = self._cameras
        given = None if frame.pose is None else pose_of(frame.pose, f"frame {frame.sequence}")
        raw = RawFrame(
            rgb=decoded_colour(frame, cameras.colour.intrinsics),
            depth_m=decoded_depth(frame, cameras.depth.intrinsics),
            colour_camera=cameras.colour,
            depth_camera=cameras.depth,
            T_colour_depth=cameras.T_colour_depth,
            T_world_camera=given,
            timestamp_s=frame.time_s,
            sequence=frame.sequence,
        )
        aligned = self._rectifier.rectify(raw)
        found = self._localiser.locate(aligned)
        if isinstance(found, Lost):
            raise StreamError(found.reason)
        self.located = found.T_world_camera
        # Bearings are in the world: without a pose the robot cannot know them.
        scan = None if frame.scan is None or given is None else _scan(frame.scan, time_s)
        seen = replace(aligned, timestamp_s=time_s).at(found.T_world_camera)
        return LiveFrame(frame=seen, scan=scan, report=report)

    def take_cloud(self, cloud: Cloud) -> None:
        assert self._localiser is not None
        points = np.frombuffer(cloud.points_m, "<f4").reshape(-1, 3).astype(np.float32)
        self._localiser.take_scan(
            PointScan(points_m=points, T_world_lidar=None, timestamp_s=cloud.time_s, sequence=cloud.sequence)
        )


def _scan(part: ScanPart, time_s: float) -> sensing.Scan:
    ranges = np.frombuffer(part.ranges_m, "<f4").astype(np.float32)
    return sensing.Scan(
        origin_m=np.array(part.origin_m, dtype=np.float64),
        bearings_rad=part.first_bearing_rad + np.arange(len(ranges)) * part.step_rad,
        ranges_m=ranges,
        timestamp_s=time_s,
    )


def _camera_of(hello: Hello) -> SE3:
    """Where its camera is, as far as it says: above the robot, or else above the origin, looking along x."""
    report, height_m = hello.report, hello.camera.mount_height_m
    if report is None:
        return level_camera_pose(0.0, 0.0, height_m, 0.0)
    return level_camera_pose(report.x_m, report.y_m, height_m, report.yaw_rad)

"""`RecordedLidar`: a recording's clouds, as messages, and how the camera sits on the lidar that took them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Final

from hgs_core.errors import StreamError
from hgs_core.live.checks import MAX_POINTS
from hgs_core.live.messages import Cloud
from hgs_core.localisation.lidar_odometry import LidarOdometryConfig, Mounting
from hgs_core.sensing.mcap_recording import McapRecording
from hgs_core.sensing.point_scan import McapScans, PointScan
from hgs_core.sensing.raw_frame import FrameSource

_METHOD: Final = LidarOdometryConfig().method
_MOUNTING: Final = tuple(f"localisation.{field.name}" for field in fields(Mounting))


class RecordedLidar:
    """The lidar beside the camera of an MCAP file."""

    def __init__(self, source: FrameSource, path: Path, topic: str | None) -> None:
        """`topic`: without a name, the only one of clouds. Raises `StreamError` for a recording without
        clouds, or whose clouds are of another clock than its frames or cannot be sent."""
        if not isinstance(source, McapRecording):
            raise StreamError(
                f"{path} is a folder in the TUM layout, which has no clouds: replay an MCAP file, or choose "
                f"another localisation.method than {_METHOD}"
            )
        self.scans = McapScans(path, topic)
        self._recording = source
        clouds_s, frames_s = self.scans.timestamps_s, source.timestamps_s
        if clouds_s[0] > frames_s[-1] or clouds_s[-1] < frames_s[0]:
            raise StreamError(
                f"{path}: {self.scans.topic} is of {clouds_s[0]:.3f} to {clouds_s[-1]:.3f} s, frames are of "
                f"{frames_s[0]:.3f} to {frames_s[-1]:.3f} s: record both with stamps of one clock"
            )
        cloud_message(next(iter(self.scans)), 0.0)

    def mounting(self, settings: Mapping[str, str]) -> dict[str, str]:
        """How the camera sat on the lidar at the first cloud, by tf, as settings of a mission; none where
        `settings` tell it. Raises `StreamError` where neither does."""
        if any(key in settings for key in _MOUNTING):
            return {}
        T_lidar_camera = self._recording.T_frame_camera(self.scans.frame, float(self.scans.timestamps_s[0]))
        if T_lidar_camera is None:
            xyz, rpy = _MOUNTING
            raise StreamError(
                f"{self._recording.name}: tf does not tell how the camera of {self._recording.topics.colour} "
                f"sits on the lidar of {self.scans.topic}, frame {self.scans.frame!r}: record /tf_static, or "
                f"say it with --set {xyz}=[X,Y,Z] --set {rpy}=[ROLL,PITCH,YAW]"
            )
        numbers = asdict(Mounting.of(T_lidar_camera)).values()
        # With a point and without an exponent: YAML takes 1e-05 for a text.
        texts = [f"[{', '.join(f'{number:.6f}' for number in three)}]" for three in numbers]
        return dict(zip(_MOUNTING, texts, strict=True))


def takes_clouds(settings: Mapping[str, str]) -> bool:
    """Whether a mission with these settings finds its poses by a lidar."""
    return settings.get("localisation.method") == _METHOD


def cloud_message(scan: PointScan, time_s: float) -> Cloud:
    """As it is sent, taken at `time_s` of the robot's clock. Raises `StreamError` for one with too many
    points."""
    if len(scan.points_m) > MAX_POINTS:
        raise StreamError(
            f"cloud {scan.sequence} has {len(scan.points_m)} points, at most {MAX_POINTS} are taken: record "
            "one thinned by a voxel filter, and name that topic with --topic cloud=/..."
        )
    return Cloud(sequence=scan.sequence, time_s=time_s, points_m=scan.points_m.astype("<f4").tobytes())

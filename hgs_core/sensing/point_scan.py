"""Scans of a spinning lidar, live or recorded."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32
from numpy import ndarray

from hgs_core.errors import SensorError
from hgs_core.geometry.se3 import SE3
from hgs_core.sensing.mcap_file import McapFile
from hgs_core.sensing.ros.clouds import POINT_CLOUD, points
from hgs_core.sensing.ros.topics import TopicChoice


@dataclass(frozen=True, kw_only=True, eq=False)
class PointScan:
    """One turn of a lidar, as if taken at one moment. Raises `SensorError` for points that are not finite."""

    points_m: Float32[ndarray, "n 3"]
    """In the lidar's own frame (x forward, y left, z up); rays without a return are left out."""
    T_world_lidar: SE3 | None
    """None where the stream does not tell."""
    timestamp_s: float
    sequence: int
    robot_id: str = "robot0"

    def __post_init__(self) -> None:
        if not bool(np.isfinite(self.points_m).all()):
            raise SensorError(f"scan {self.sequence}: points must be finite; leave out rays without a return")


class McapScans:
    """The `PointCloud2` messages of an MCAP file, as scans without poses, in the order of the file and of the
    times in their headers.

    Without `topic`, the only one that holds clouds. Raises `StreamError` naming the topics there are, and for
    times that do not rise.
    """

    def __init__(self, path: Path, topic: str | None = None) -> None:
        self._file = McapFile(path)
        self.name = path.stem
        choice = TopicChoice(
            {t.name: t.schema for t in self._file.topics if t.n_messages > 0},
            source=str(path),
            described=self._file.described(),
            is_depth=lambda _: False,
            tf_reaches=lambda _: False,
        )
        self.topic = choice.only(topic, "cloud", (POINT_CLOUD,))
        self.timestamps_s: Float[ndarray, " n_scans"] = self._file.stamps_s(self.topic)
        self.frame: str = self._file.decode(self._file.first(self.topic)).header.frame_id
        """The lidar's, in tf."""

    def __len__(self) -> int:
        return len(self.timestamps_s)

    def __iter__(self) -> Iterator[PointScan]:
        for message in self._file.messages([self.topic]):
            yield PointScan(
                points_m=points(self._file.decode(message), message.where),
                T_world_lidar=None,
                timestamp_s=message.stamp_s(),
                sequence=message.number,
            )

"""The scans of a mission, kept to build the voxels anew from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from jaxtyping import Float, Float32
from numpy import ndarray

from hgs_core.geometry.se3 import SE3
from hgs_core.sensing.frame import Scan


class ScanLog:
    """Scans in the order they came, each with the keyframe whose drift it shares. 6 kB a scan of 720 rays."""

    def __init__(self) -> None:
        self._anchors: list[int] = []
        self._origins_m: list[Float[ndarray, " 3"]] = []
        self._bearings_rad: list[Float32[ndarray, " n_rays"]] = []
        self._ranges_m: list[Float32[ndarray, " n_rays"]] = []
        self._timestamps_s: list[float] = []

    def __len__(self) -> int:
        return len(self._anchors)

    def add(self, scan: Scan, *, anchor_keyframe: int) -> None:
        self._anchors.append(anchor_keyframe)
        self._origins_m.append(np.array(scan.origin_m, dtype=float))
        self._bearings_rad.append(scan.bearings_rad.astype(np.float32))
        self._ranges_m.append(scan.ranges_m.copy())
        self._timestamps_s.append(scan.timestamp_s)

    def of_keyframe(self, anchor_keyframe: int) -> Iterator[Scan]:
        """Its scans, in order."""
        for k in np.flatnonzero(np.array(self._anchors, dtype=int) == anchor_keyframe):
            yield Scan(
                origin_m=self._origins_m[k],
                bearings_rad=self._bearings_rad[k].astype(np.float64),
                ranges_m=self._ranges_m[k],
                timestamp_s=self._timestamps_s[k],
            )

    def move(self, motions: Mapping[int, SE3]) -> None:
        """Take scans along with their keyframes: origins move, bearings turn about the vertical. A tilt of
        the motion is left out: scans stay level."""
        for k, anchor in enumerate(self._anchors):
            motion = motions.get(anchor)
            if motion is None:
                continue
            turned_rad = np.arctan2(motion.rotation[1, 0], motion.rotation[0, 0])
            self._origins_m[k] = motion.apply(self._origins_m[k])
            self._bearings_rad[k] = (self._bearings_rad[k] + turned_rad).astype(np.float32)

    def state(self) -> dict[str, Any]:
        return {
            "anchors": list(self._anchors),
            "origins_m": np.array(self._origins_m).reshape(-1, 3),
            "n_rays": [len(ranges) for ranges in self._ranges_m],
            "bearings_rad": np.concatenate([np.zeros(0, np.float32), *self._bearings_rad]),
            "ranges_m": np.concatenate([np.zeros(0, np.float32), *self._ranges_m]),
            "timestamps_s": list(self._timestamps_s),
        }

    @staticmethod
    def restore(state: dict[str, Any]) -> ScanLog:
        log = ScanLog()
        ends = np.cumsum(state["n_rays"])[:-1]
        if len(state["anchors"]) > 0:
            log._anchors = [int(anchor) for anchor in state["anchors"]]
            log._origins_m = list(np.array(state["origins_m"]))
            log._bearings_rad = np.split(np.array(state["bearings_rad"]), ends)
            log._ranges_m = np.split(np.array(state["ranges_m"]), ends)
            log._timestamps_s = [float(stamp) for stamp in state["timestamps_s"]]
        return log

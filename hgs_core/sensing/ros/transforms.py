"""`tf2_msgs/TFMessage`: how coordinate frames stand in each other."""

from __future__ import annotations

from collections import defaultdict
from typing import Any, Final

from hgs_core.errors import StreamError
from hgs_core.geometry.se3 import SE3
from hgs_core.sensing.ros.poses import StampedPoses, stamp_s, transform

TF_MESSAGE: Final = "tf2_msgs/msg/TFMessage"


class TransformTree:
    """Every frame has one parent; transforms between any two frames of a tree chain over their ancestors.

    Moving transforms are interpolated (`StampedPoses`).
    """

    def __init__(self, *, offset_s: float, gap_s: float) -> None:
        self._offset_s = offset_s
        self._gap_s = gap_s
        self._parents: dict[str, str] = {}
        self._fixed: dict[str, SE3] = {}
        self._stamped: dict[str, list[tuple[float, SE3]]] = defaultdict(list)
        self._moving: dict[str, StampedPoses] = {}

    def add(self, message: Any, where: str, *, static: bool) -> None:
        """Take a TFMessage in. Raises `StreamError` for a frame with two parents or a bad transform."""
        for stamped in message.transforms:
            child, parent = _name(stamped.child_frame_id), _name(stamped.header.frame_id)
            if self._parents.setdefault(child, parent) != parent:
                raise StreamError(
                    f"{where}: frame {child!r} has two parents, {self._parents[child]!r} and {parent!r}: "
                    "two programs publish it; record one of them"
                )
            T = transform(stamped.transform, f"{where}, {parent} to {child}")
            if static:
                self._fixed[child] = T
            else:
                self._stamped[child].append((stamp_s(stamped.header), T))
                self._moving.pop(child, None)

    @property
    def frames(self) -> list[str]:
        """All frame names, sorted."""
        return sorted({*self._parents, *self._parents.values()})

    def is_connected(self, target: str, source: str) -> bool:
        """Whether the two frames hang together, at whatever time."""
        return self._chain(_name(target))[-1] == self._chain(_name(source))[-1]

    def lookup(self, target: str, source: str, time_s: float) -> SE3 | None:
        """`T_target_source` at that time; None where a transform on the way was not sent near enough in time.

        Raises `StreamError` when the two frames do not hang together.
        """
        up, down = self._chain(_name(source)), self._chain(_name(target))
        if up[-1] != down[-1]:
            raise StreamError(
                f"no transform leads from {source!r} to {target!r}; tf has the frames "
                f"{', '.join(self.frames) or '(none)'}"
            )
        T_root_source, T_root_target = self._to_root(up, time_s), self._to_root(down, time_s)
        if T_root_source is None or T_root_target is None:
            return None
        return T_root_target.inverse() @ T_root_source

    def _chain(self, frame: str) -> list[str]:
        """The frame and its ancestors."""
        chain = [frame]
        while chain[-1] in self._parents:
            parent = self._parents[chain[-1]]
            if parent in chain:
                raise StreamError(f"tf goes in a circle: {' -> '.join([*chain, parent])}")
            chain.append(parent)
        return chain

    def _to_root(self, chain: list[str], time_s: float) -> SE3 | None:
        T = SE3.identity()
        for frame in chain[:-1]:
            step = self._fixed.get(frame)
            if step is None:
                if frame not in self._moving:
                    self._moving[frame] = StampedPoses(
                        self._stamped[frame], offset_s=self._offset_s, gap_s=self._gap_s
                    )
                step = self._moving[frame].at(time_s)
            if step is None:
                return None
            T = step @ T
        return T


def _name(frame: str) -> str:
    """Old recordings write `/map` for `map`."""
    return frame.removeprefix("/")

"""ROS 2 messages as rosbridge writes them: JSON, with bytes in base64."""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, TypeVar

from hgs_core.errors import StreamError
from hgs_core.robot.motion import Twist
from hgs_core.robot.path import Path

T = TypeVar("T")

PATH = "nav_msgs/msg/Path"
TWIST = "geometry_msgs/msg/Twist"


def read(content: Any, decode: Callable[[Any, str], T], where: str) -> T:
    """What `decode` makes of a message's JSON. Raises `StreamError` for one that lacks what it needs."""
    try:
        return decode(_as_object(content), where)
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
        raise StreamError(f"{where} is not the message that it should be: {error}") from error


def bytes_of(data: Any, where: str) -> bytes:
    """An array of uint8: base64, or (from servers without) numbers."""
    try:
        if isinstance(data, str):
            return base64.b64decode(data, validate=True)
        if isinstance(data, list):
            return bytes(data)
    except (binascii.Error, TypeError, ValueError) as error:
        raise StreamError(f"{where}: its data are neither base64 nor bytes: {error}") from error
    raise StreamError(f"{where}: its data are neither base64 nor bytes, but {type(data).__name__}")


def twist_content(twist: Twist) -> dict[str, Any]:
    """A `geometry_msgs/Twist`."""
    return {
        "linear": {"x": twist.forward_mps, "y": twist.left_mps, "z": 0.0},
        "angular": {"x": 0.0, "y": 0.0, "z": twist.turn_radps},
    }


def path_content(path: Path | None, *, frame: str, stamp_s: float) -> dict[str, Any]:
    """A `nav_msgs/Path`; None: one without poses, which means that there is nowhere to go.

    A pose's heading is the one to take up there, else the car's, else the way's.
    """
    seconds = math.floor(stamp_s)
    header = {"frame_id": frame, "stamp": {"sec": seconds, "nanosec": int(1e9 * (stamp_s - seconds))}}
    positions = [] if path is None else path.positions_m.tolist()
    yaws = [] if path is None else _headings(path)
    return {
        "header": header,
        "poses": [
            {
                "header": header,
                "pose": {
                    "position": {"x": x, "y": y, "z": 0.0},
                    "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)},
                },
            }
            for (x, y), yaw in zip(positions, yaws, strict=True)
        ],
    }


def _headings(path: Path) -> list[float]:
    points, headings = path.positions_m.tolist(), []
    along = 0.0
    for k, yaw in enumerate(path.yaws_rad.tolist()):
        if k + 1 < len(points):
            along = math.atan2(points[k + 1][1] - points[k][1], points[k + 1][0] - points[k][0])
        driven = along if path.headings_rad is None else float(path.headings_rad[k])
        headings.append(driven if math.isnan(yaw) else yaw)
    return headings


def _as_object(content: Any) -> Any:
    """As the decoders of recorded messages take it."""
    if isinstance(content, dict):
        return SimpleNamespace(**{str(key): _as_object(value) for key, value in content.items()})
    if isinstance(content, list) and content and isinstance(content[0], dict | list):
        return [_as_object(value) for value in content]
    return content

"""Angles: radians inside, degrees outside."""

from __future__ import annotations

import math
from typing import Any


def in_degrees(value: Any) -> Any:
    """`value` with every `NAME_rad` entry as `NAME_deg`."""
    if isinstance(value, dict):
        return dict(_entry(key, entry) for key, entry in value.items())
    if isinstance(value, list):
        return [in_degrees(entry) for entry in value]
    return value


def _entry(key: str, value: Any) -> tuple[str, Any]:
    if key.endswith("_rad"):
        degrees = None if value is None else math.degrees(value)
        return f"{key.removesuffix('_rad')}_deg", degrees
    return key, in_degrees(value)

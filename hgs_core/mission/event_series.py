"""What a run's `events.jsonl` tells over time, as columns."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.errors import ConfigError
from hgs_core.mission.repeats import newest_course


@dataclass(frozen=True, kw_only=True, eq=False)
class EventSeries:
    """One entry a frame, and one a planning cycle; NaN where nothing was measured."""

    time_s: Float[ndarray, " n_frames"]
    path_length_m: Float[ndarray, " n_frames"]
    observed_volume_m3: Float[ndarray, " n_frames"]
    missing_volume_m3: Float[ndarray, " n_frames"]
    psnr_current_db: Float[ndarray, " n_frames"]
    n_gaussians: Float[ndarray, " n_frames"]
    mapping_s: Float[ndarray, " n_frames"]
    plan_time_s: Float[ndarray, " n_plans"]
    planning_s: Float[ndarray, " n_plans"]

    @property
    def observed_share(self) -> Float[ndarray, " n_frames"]:
        """Observed volume / (observed + known to be missing); NaN before the first plan has looked."""
        known = self.observed_volume_m3 + self.missing_volume_m3
        looked = self.time_s >= (self.plan_time_s[0] if len(self.plan_time_s) else np.inf)
        return np.where(looked & (known > 0), self.observed_volume_m3 / np.where(known > 0, known, 1), np.nan)


def read_event_series(path: Path) -> EventSeries:
    """Raises `ConfigError` for a file that is missing or holds a line that is no event."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror}") from error
    frames: list[dict[str, Any]] = []
    plans: list[dict[str, Any]] = []
    for number, line in enumerate(lines, start=1):
        try:
            event = json.loads(line)
            {"telemetry": frames, "plan": plans}.get(event["kind"], []).append(event)
        except (ValueError, KeyError, TypeError) as error:
            raise ConfigError(f"{path}:{number} is not an event: {error!r}") from error

    frames, plans = _newest_course(frames), _newest_course(plans)

    def column(events: list[dict[str, Any]], key: str) -> Float[ndarray, " n"]:
        values = [event.get(key) for event in events]
        return np.array([np.nan if value is None else value for value in values], dtype=float)

    return EventSeries(
        time_s=column(frames, "time_s"),
        path_length_m=column(frames, "path_length_m"),
        observed_volume_m3=column(frames, "observed_volume_m3"),
        missing_volume_m3=column(frames, "missing_volume_m3"),
        psnr_current_db=column(frames, "psnr_current_db"),
        n_gaussians=column(frames, "n_gaussians"),
        mapping_s=column(frames, "mapping_s"),
        plan_time_s=column(plans, "time_s"),
        planning_s=column(plans, "planning_s"),
    )


def _newest_course(events: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return list(compress(events, newest_course([event["time_s"] for event in events])))

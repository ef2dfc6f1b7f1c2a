"""Columns out of `events.jsonl`."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hgs_core.errors import ConfigError
from hgs_core.mission.event_series import read_event_series


def telemetry(time_s: float, **figures: Any) -> dict[str, Any]:
    zero = dict.fromkeys(("path_length_m", "observed_volume_m3", "missing_volume_m3"), 0.0)
    return {"kind": "telemetry", "time_s": time_s, **zero, **figures}


def write(path: Path, events: list[dict[str, Any]]) -> None:
    path.write_text("".join(json.dumps(event) + "\n" for event in events))


def test_frames_and_plans_become_columns(tmp_path: Path) -> None:
    events = [
        {"kind": "phase", "time_s": 0.0, "phase": "running"},
        telemetry(0.0, psnr_current_db=None, observed_volume_m3=10.0),
        {"kind": "plan", "time_s": 0.3, "planning_s": 0.125},
        telemetry(0.4, psnr_current_db=27.5, observed_volume_m3=30.0, missing_volume_m3=10.0),
    ]
    write(tmp_path / "events.jsonl", events)
    series = read_event_series(tmp_path / "events.jsonl")
    np.testing.assert_array_equal(series.time_s, [0.0, 0.4])
    np.testing.assert_array_equal(series.psnr_current_db, [np.nan, 27.5])
    np.testing.assert_array_equal(series.planning_s, [0.125])
    # Before the first plan nobody had looked what is missing.
    np.testing.assert_array_equal(series.observed_share, [np.nan, 0.75])
    # A figure that an older run did not log was not measured.
    assert np.isnan(series.n_gaussians).all()


def test_a_run_without_frames_has_empty_columns(tmp_path: Path) -> None:
    write(tmp_path / "events.jsonl", [])
    series = read_event_series(tmp_path / "events.jsonl")
    assert len(series.time_s) == len(series.observed_share) == len(series.planning_s) == 0


@pytest.mark.parametrize("line", ["{", "[]", '{"time_s": 0}'])
def test_a_damaged_line_is_named(tmp_path: Path, line: str) -> None:
    (tmp_path / "events.jsonl").write_text('{"kind": "notice"}\n' + line + "\n")
    with pytest.raises(ConfigError, match=r"events\.jsonl:2"):
        read_event_series(tmp_path / "events.jsonl")
    with pytest.raises(ConfigError, match="cannot read"):
        read_event_series(tmp_path / "absent.jsonl")


def test_of_a_mission_that_took_another_course_from_a_checkpoint_the_newest_counts(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    told = [(0.0, 1), (0.4, 2), (0.8, 3), (1.2, 4), (0.7, 5), (1.0, 6), (1.4, 7), (1.3, 8)]
    lines = [{"kind": "telemetry", "time_s": time_s, "n_gaussians": n} for time_s, n in told]
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    series = read_event_series(path)
    assert series.n_gaussians.tolist() == [1, 2, 5, 6, 8]
    assert series.time_s.tolist() == [0.0, 0.4, 0.7, 1.0, 1.3]

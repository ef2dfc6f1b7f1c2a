"""Hundreds of awkward houses: every mission ends by itself and touches nothing."""

import csv
import os
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
@pytest.mark.timeout(4 * 3600)
@pytest.mark.parametrize(
    ("houses", "settings"),
    [("warren:0-199", []), ("warren:200-219", ["--set", "sensor=rgbd_5m_tiny_glass"])],
    ids=["houses", "glass"],
)
def test_best_ends_by_itself_and_touches_nothing(
    houses: str, settings: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`HGS_ROBUSTNESS_DIR` keeps the grid, so that a broken-off run goes on."""
    out = Path(os.environ.get("HGS_ROBUSTNESS_DIR", tmp_path)) / houses.replace(":", "-")
    command = [Path(sys.executable).with_name("hgs"), "bench", "planners", "--scenes", houses]
    command += ["--planners", "best", "--seeds", "0", "--preset", "robust", "--out", str(out), *settings]
    subprocess.run(command, check=True)
    with capsys.disabled():
        sys.stdout.write((out / "shortfalls.md").read_text(encoding="utf-8"))
    with (out / "results.csv").open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    low, high = map(int, houses.split(":")[1].split("-"))
    assert len(rows) == high - low + 1
    assert {row["stop_reason"] for row in rows} == {"complete"}
    assert [row["scene"] for row in rows if int(row["collisions"]) > 0] == []

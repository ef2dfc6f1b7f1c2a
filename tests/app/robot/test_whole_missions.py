"""Whole missions over loopback by the real clock: `hgs robot` against `hgs serve`, each a process.

What it takes depends on the machine, so only what must hold on any is asserted; the figures are printed.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from hgs_core.evaluation.report import MissionReport
from tests.app.served import served

PATIENCE_S = 3000.0


@pytest.mark.slow
@pytest.mark.timeout(2 * PATIENCE_S)
@pytest.mark.parametrize("vehicle", ["differential", "ackermann"])
@pytest.mark.parametrize("scene", ["house", "aws_small_house.glb"])
def test_a_whole_mission(request, tmp_path, capsys, scene: str, vehicle: str) -> None:
    source = scene
    if scene.endswith(".glb"):
        source = str(request.getfixturevalue("shared_dir") / "scenes" / scene)
    with served(tmp_path / "data", viewer=False) as service:
        out = tmp_path / "out"
        options = ["--server", service.url, "--scene", source, "--vehicle", vehicle, "--out", str(out)]
        done = subprocess.run(
            [str(Path(sys.executable).with_name("hgs")), "robot", *options],
            timeout=PATIENCE_S,
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode == 0, done.stderr
    report = MissionReport.read(out / "report.json")
    robot = json.loads((out / "robot.json").read_text())
    with capsys.disabled():
        sys.stdout.write(
            f"\n{scene}, {vehicle}: {report.stop_reason}, {report.collisions} collisions, observable "
            f"completion ratio {report.completion_ratio_observable:.3f}, path {report.path_length_m:.1f} m, "
            f"{report.sim_time_s:.0f} s, real-time factor {report.real_time_factor:.2f}, frame to map p95 "
            f"{robot['sent_to_map_s']['p95']:.2f} s\n"
        )
    assert report.stop_reason == "complete"
    assert report.collisions == 0
    assert report.completion_ratio_observable is not None
    assert report.completion_ratio_observable >= 0.93

"""What of a grid went wrong, mission by mission."""

from __future__ import annotations

import json
from pathlib import Path

from hgs_core.benchmark.planners.results import GridResults
from hgs_core.benchmark.planners.shortfalls import shortfalls
from tests.benchmark.planners.fake_cells import FAILING, STUCK, asked, run_fake_grid


def test_only_what_fell_short_is_listed_with_its_reasons(tmp_path: Path) -> None:
    run_fake_grid(*asked(tmp_path, planners=["best"], seeds=[0, 1, 2, FAILING, STUCK]))
    path = tmp_path / "cells" / "house" / "best-2" / "report.json"
    report = json.loads(path.read_text())
    box = {"lower_m": [0, 0, 0], "upper_m": [1, 1, 1]}
    report["completion_ratio_observable"] = 0.85
    report["unseen"] = [
        {"region": box, "volume_m3": 0.5, "reason": "below_threshold"},
        {"region": box, "volume_m3": 2.0, "reason": "unreachable"},
        {"region": box, "volume_m3": 1.0, "reason": "below_threshold"},
    ]
    path.write_text(json.dumps(report))
    text = shortfalls(GridResults.read(tmp_path))
    assert (
        "4 of 5 missions finished; 3 ended by themselves; 2 collisions; "
        "observable completion ratio below 0.9: 1 of 4 (25.0%)." in text
    )
    rows = [line for line in text.splitlines() if line.startswith("| house")]
    assert [row.split("|")[2].strip() for row in rows] == ["1", "2", str(FAILING), str(STUCK)]
    assert "| 1 collisions |" in rows[0]
    assert "| 0.850 | 11.0 m | saw too little | unreachable 2.0 m³, below threshold 1.5 m³ |" in rows[1]
    assert "failed: SceneError: no floor" in rows[2]
    assert "ended by stuck" in rows[3]

"""`shortfalls.md`: what went wrong or stayed unseen, mission by mission; all that matters of a large grid."""

from __future__ import annotations

from collections import defaultdict
from typing import Final

from hgs_core.benchmark.planners.cell import CellResult
from hgs_core.benchmark.planners.results import GridResults, number_at

LEAST_RATIO: Final = 0.9
"""Missions with a lower observable completion ratio are listed."""


def shortfalls(results: GridResults) -> str:
    """How many missions ended by themselves, touched nothing and saw enough, and each that did not."""
    lines = ["# Missions that fell short", ""]
    for planner in results.grid.planners:
        cells = [one for key, one in results.cells.items() if key.planner == planner]
        lines += [*_summary(planner, cells), ""]
        short = [one for one in cells if _faults(one)]
        if short:
            lines += ["| scene | seed | observable C.R. | path | why | left unseen, by reason |"]
            lines += ["| :-- | --: | --: | --: | :-- | :-- |", *map(_row, short), ""]
    return "\n".join(lines)


def _summary(planner: str, cells: list[CellResult]) -> list[str]:
    finished = [one for one in cells if one.report is not None]
    by_themselves = sum(_stop_reason(one) == "complete" for one in finished)
    collisions = sum(_figure(one, "collisions") or 0.0 for one in finished)
    ratios = [ratio for one in finished if (ratio := _figure(one, "completion_ratio_observable")) is not None]
    below = sum(ratio < LEAST_RATIO for ratio in ratios)
    share = f"{below} of {len(ratios)} ({below / len(ratios):.1%})" if ratios else "none measured"
    return [
        f"## {planner}",
        "",
        f"{len(finished)} of {len(cells)} missions finished; {by_themselves} ended by themselves; "
        f"{collisions:.0f} collisions; observable completion ratio below {LEAST_RATIO}: {share}.",
    ]


def _faults(one: CellResult) -> list[str]:
    if one.report is None:
        return [f"{one.status}: {one.message}"]
    faults = []
    if _stop_reason(one) != "complete":
        faults.append(f"ended by {_stop_reason(one).replace('_', ' ')}: {one.report.get('stop_message')}")
    collisions = _figure(one, "collisions") or 0.0
    if collisions > 0:
        faults.append(f"{collisions:.0f} collisions")
    ratio = _figure(one, "completion_ratio_observable")
    if ratio is None:
        faults.append("not evaluated")
    elif ratio < LEAST_RATIO:
        faults.append("saw too little")
    return faults


def _row(one: CellResult) -> str:
    ratio, path_m = _figure(one, "completion_ratio_observable"), _figure(one, "path_length_m")
    cells = [
        one.key.scene,
        str(one.key.seed),
        "-" if ratio is None else f"{ratio:.3f}",
        "-" if path_m is None else f"{path_m:.1f} m",
        "; ".join(_faults(one)).replace("|", "/"),
        _unseen(one),
    ]
    return "| " + " | ".join(cells) + " |"


def _unseen(one: CellResult) -> str:
    """Volumes that the mission left unseen, summed by its own reasons."""
    volumes: dict[str, float] = defaultdict(float)
    for region in (one.report or {}).get("unseen", ()):
        volumes[str(region["reason"]).replace("_", " ")] += float(region["volume_m3"])
    listed = sorted(volumes.items(), key=lambda item: -item[1])
    return ", ".join(f"{reason} {volume:.1f} m³" for reason, volume in listed) or "-"


def _stop_reason(one: CellResult) -> str:
    return str((one.report or {}).get("stop_reason"))


def _figure(one: CellResult, key: str) -> float | None:
    return None if one.report is None else number_at(one.report, key)

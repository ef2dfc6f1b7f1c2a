"""The tables of a grid: the paper's two, one of further planners, one of paths."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from hgs_core.benchmark.planners.results import GridResults, Report, number_at
from hgs_core.benchmark.planners.roster import BEST, METHODS, VARIANTS, every, further
from hgs_core.benchmark.planners.spread import Spread
from hgs_core.benchmark.planners.table import Column, Entry, Table, build_table

ReferencePaths = Mapping[str, Mapping[float, float]]
"""Scene -> observable completion ratio (0.90, 0.95) -> length [m] of a path found with full knowledge."""

SHARES: Final = {0.90: "path_m_at_90", 0.95: "path_m_at_95"}
"""Observable completion ratios, and the report's key of the path to each."""

_ACCURACY: Final = Column.of_key("accuracy_cm", "Acc ↓", "cm", 2, "least")
_STRICT: Final = (
    _ACCURACY,
    Column.of_key("completion_cm", "Comp ↓", "cm", 2, "least"),
    Column.of_key("completion_ratio", "C.R. ↑", "", 3, "most"),
)
_OBSERVABLE: Final = (
    _ACCURACY,
    Column.of_key("completion_cm_observable", "Comp ↓", "cm", 2, "least"),
    Column.of_key("completion_ratio_observable", "C.R. ↑", "", 3, "most"),
)
_EVALUATION_S: Final = Column.of_key("planning_s.viewpoint_evaluation", "T_VE", "s", 3)
_PLANNING_S: Final = Column.of_key("planning_s.median", "T_P", "s", 3)
_PATH: Final = Column.of_key("path_length_m", "P.L.", "m", 1)


def all_tables(results: GridResults, reference_m: ReferencePaths | None = None) -> list[Table]:
    """Every table that has a row in this grid."""
    planners = results.grid.planners
    variants = [*VARIANTS, BEST]
    methods = [*METHODS, BEST]
    beside = [entry for entry in methods if entry.preset in ("paper", BEST.preset)]
    others = further(planners)
    tables = [
        build_table(results, f"Table I, {what}", variants, columns, with_marks=True)
        for what, columns in (
            ("effectiveness: whole surface (strict)", _STRICT),
            ("effectiveness: observable surface", _OBSERVABLE),
            ("efficiency", (_EVALUATION_S, _PLANNING_S, _PATH)),
        )
    ]
    for title, entries in (("Table II", methods), ("Table III, further planners", [*others, *beside])):
        if title != "Table II" and not others:
            continue
        for what, columns in (("whole surface (strict)", _STRICT), ("observable surface", _OBSERVABLE)):
            tables.append(build_table(results, f"{title}: {what}", entries, (*columns, _PLANNING_S, _PATH)))
    tables += [_path_table(results, reference_m or {}), _endings(results)]
    return [table for table in tables if table.rows]


def _path_table(results: GridResults, reference_m: ReferencePaths) -> Table:
    columns = []
    for share in SHARES:
        columns.append(_path_column(share))
        if any(share in lengths for lengths in reference_m.values()):
            columns.append(_multiple_column(share, reference_m))
    area = Column(name="area ↑", unit="", decimals=3, spread=GridResults.area, best="most")
    title = "Path to observable completion ratios, and area under completion over path"
    return build_table(results, title, every(results.grid.planners), [*columns, area])


def _path_column(share: float) -> Column:
    def spread(results: GridResults, planner: str, scene: str) -> Spread:
        return results.spread(planner, scene, lambda report: number_at(report, SHARES[share]), _without_path)

    return Column(name=f"path to {share:.2f} ↓", unit="m", decimals=1, spread=spread, best="least")


def _multiple_column(share: float, reference_m: ReferencePaths) -> Column:
    """The path as a multiple of the full-knowledge path to the same completion."""

    def spread(results: GridResults, planner: str, scene: str) -> Spread:
        length_m = reference_m.get(scene, {}).get(share)

        def multiple(report: Report) -> float | None:
            path_m = number_at(report, SHARES[share])
            return None if path_m is None or length_m is None else path_m / length_m

        absent = _without_path if length_m is not None else lambda report: "no reference"
        return results.spread(planner, scene, multiple, absent)

    return Column(name=f"× reference to {share:.2f} ↓", unit="", decimals=2, spread=spread, best="least")


def _without_path(report: Report) -> str:
    return "not reached" if report.get("completion_curve") else "no curve"


def _endings(results: GridResults) -> Table:
    """How the missions of each planner ended on each scene, and how often they touched something."""
    column = Column(name="ended", unit="", decimals=0, spread=_collisions)
    planners = every(results.grid.planners)
    table = build_table(results, "How the missions ended", planners, [column])
    rows = [
        replace(row, entries=tuple(Entry(text=_ending(results, row.planner.preset, s)) for s in table.scenes))
        for row in table.rows
    ]
    return replace(table, rows=tuple(rows))


def _ending(results: GridResults, planner: str, scene: str) -> str:
    cells = results.of(planner, scene)
    ends = Counter(
        str(cell.status) if cell.report is None else str(cell.report.get("stop_reason")) for cell in cells
    )
    parts = [f"{n} {end.replace('_', ' ')}" for end, n in ends.items()]
    touched = sum(int(number_at(cell.report, "collisions") or 0) for cell in cells if cell.report is not None)
    if touched:
        parts.append(f"{touched} collision{'s' if touched > 1 else ''}")
    return ", ".join(parts) or "–"


def _collisions(results: GridResults, planner: str, scene: str) -> Spread:
    return results.spread(planner, scene, lambda report: number_at(report, "collisions"))

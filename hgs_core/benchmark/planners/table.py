"""A table as the paper sets it: planners as rows, the same figures of every scene side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from hgs_core.benchmark.planners.results import GridResults, number_at
from hgs_core.benchmark.planners.roster import PlannerEntry
from hgs_core.benchmark.planners.spread import Spread


@dataclass(frozen=True, kw_only=True)
class Column:
    """One figure of each scene."""

    name: str
    """With an arrow towards better where one way is better; a subscript follows `_`."""
    unit: str
    decimals: int
    spread: Callable[[GridResults, str, str], Spread]
    """Of a planner on a scene."""
    best: Literal["least", "most"] | None = None
    """Which value of a scene is set bold; None: none is."""

    @staticmethod
    def of_key(
        key: str,
        name: str,
        unit: str,
        decimals: int,
        best: Literal["least", "most"] | None = None,
    ) -> Column:
        """A figure of `report.json`."""

        def spread(results: GridResults, planner: str, scene: str) -> Spread:
            return results.spread(planner, scene, lambda report: number_at(report, key))

        return Column(name=name, unit=unit, decimals=decimals, spread=spread, best=best)


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One place of the table."""

    text: str
    is_best: bool = False


@dataclass(frozen=True, kw_only=True)
class Row:
    """One planner."""

    planner: PlannerEntry
    entries: tuple[Entry, ...]
    """Scene by scene, its columns in order."""
    conditions: str
    """Preset, seeds, threads, kernels, commit."""


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows over scenes and columns."""

    title: str
    with_marks: bool
    """Whether rows say which mechanisms a planner has (the paper's Table I)."""
    scenes: tuple[str, ...]
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]


def build_table(
    results: GridResults,
    title: str,
    planners: Sequence[PlannerEntry],
    columns: Sequence[Column],
    *,
    with_marks: bool = False,
) -> Table:
    """The table of those `planners` that the grid asks for. The best of a column is marked among those whose
    seeds are all there, as it is printed: equal prints are equally best."""
    shown = [planner for planner in planners if planner.preset in results.grid.planners]
    places = [(scene, column) for scene in results.grid.scenes for column in columns]
    entries = {
        (scene, column.name): _entries(results, scene, column, [planner.preset for planner in shown])
        for scene, column in places
    }
    rows = [
        Row(
            planner=planner,
            entries=tuple(entries[scene, column.name][planner.preset] for scene, column in places),
            conditions=conditions(results, planner.preset),
        )
        for planner in shown
    ]
    return Table(
        title=title,
        with_marks=with_marks,
        scenes=tuple(results.grid.scenes),
        columns=tuple(columns),
        rows=tuple(rows),
    )


def conditions(results: GridResults, planner: str) -> str:
    """Under which conditions the cells of a row ran; every value that occurs is named."""
    cells = [result for key, result in results.cells.items() if key.planner == planner]
    seeds = sorted({result.key.seed for result in cells})
    reports = [result.report for result in cells if result.report is not None]
    records = [result.record for result in cells if result.record is not None and result.report is not None]
    threads = {str(report.get("threads")) for report in reports}
    variants = {str(report.get("kernel_variant")) for report in reports}
    commits = {record.commit for record in records}
    seed_word = "seed" if len(seeds) == 1 else "seeds"
    thread_word = "thread" if threads == {"1"} else "threads"
    parts = [results.grid.preset, f"{seed_word} {', '.join(map(str, seeds))}"]
    if reports:
        parts += [f"{_any_of(threads)} {thread_word}", _any_of(variants), _any_of(commits)]
    return "; ".join(parts)


def _any_of(values: set[str]) -> str:
    return ", ".join(sorted(values)) or "?"


def _entries(results: GridResults, scene: str, column: Column, planners: Sequence[str]) -> dict[str, Entry]:
    spreads = {planner: column.spread(results, planner, scene) for planner in planners}
    printed = {
        planner: float(f"{spread.mean:.{column.decimals}f}")
        for planner, spread in spreads.items()
        if spread.is_whole and spread.mean is not None
    }
    best: float | None = None
    if column.best is not None and len(printed) > 1:
        best = min(printed.values()) if column.best == "least" else max(printed.values())
    return {
        planner: Entry(
            text=spread.text(column.decimals), is_best=best is not None and printed.get(planner) == best
        )
        for planner, spread in spreads.items()
    }

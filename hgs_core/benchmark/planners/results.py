"""Everything that is known of a grid, read from its cells, and `results.csv`."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hgs_core.benchmark.planners.cell import CellFiles, CellKey, CellResult, CellStatus
from hgs_core.benchmark.planners.curve import CompletionCurve, area_under, longest_m
from hgs_core.benchmark.planners.grid import GridFile
from hgs_core.benchmark.planners.spread import Spread

Report = Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class GridResults:
    """A grid as far as it is run; nothing but files of its folder went into it."""

    root: Path
    grid: GridFile
    cells: Mapping[CellKey, CellResult]

    @staticmethod
    def read(root: Path) -> GridResults:
        """Raises `ConfigError` where `root` holds no grid, or a file in it is damaged."""
        grid = GridFile.read(root)
        cells = {key: CellFiles(root, key).read() for key in grid.cells}
        return GridResults(root=root, grid=grid, cells=cells)

    def of(self, planner: str, scene: str) -> list[CellResult]:
        """By seed; empty where the grid asks for none."""
        return [self.cells[key] for key in self.grid.of(planner, scene)]

    def spread(
        self,
        planner: str,
        scene: str,
        figure: Callable[[Report], float | None],
        absent: Callable[[Report], str] = lambda report: "not measured",
    ) -> Spread:
        """A figure of the report over the seeds of one planner on one scene.

        `absent` says in a word why a finished mission has no such figure.
        """
        values: list[float | None] = []
        missing: dict[str, None] = {}
        for result in self.of(planner, scene):
            value = None if result.report is None else figure(result.report)
            values.append(value)
            if value is None:
                missing[str(result.status) if result.report is None else absent(result.report)] = None
        return Spread.of(values, missing=", ".join(missing))

    def curves(self, planner: str, scene: str) -> list[CompletionCurve]:
        """Of the finished missions whose report has one, by seed."""
        reports = [one.report for one in self.of(planner, scene) if one.report is not None]
        return [curve for report in reports if (curve := CompletionCurve.of(report)) is not None]

    def area_length_m(self, scene: str) -> float:
        """Over how much way areas on this scene are taken: the longest of any planner and seed."""
        return longest_m([curve for planner in self.grid.planners for curve in self.curves(planner, scene)])

    def area(self, planner: str, scene: str) -> Spread:
        """Normalised area under completion over path."""
        length_m = self.area_length_m(scene)

        def of(report: Report) -> float | None:
            curve = CompletionCurve.of(report)
            return None if curve is None or length_m == 0 else area_under(curve, length_m)

        return self.spread(planner, scene, of, lambda report: "no curve")

    def counted(self, status: CellStatus) -> int:
        return sum(one.status is status for one in self.cells.values())


def number_at(report: Report, path: str) -> float | None:
    """The number under a key like `planning_s.median`; None where there is no such key or number."""
    value: Any = report
    for key in path.split("."):
        value = value.get(key) if isinstance(value, Mapping) else None
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def results_csv(results: GridResults) -> str:
    """One row a cell of the grid, in the grid's order: planner, scene, seed, preset, status, and every scalar
    of `report.json` (`planning_s.median` for nested ones). What a cell does not have stays empty."""
    scalars = [{} if one.report is None else _scalars(one.report) for one in results.cells.values()]
    first = ("planner", "scene", "seed", "preset", "status")
    keys = [key for key in dict.fromkeys(key for row in scalars for key in row) if key not in first]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*first, *keys, "commit", "failure"])
    for result, row in zip(results.cells.values(), scalars, strict=True):
        key, commit = result.key, "" if result.record is None else result.record.commit
        head = [key.planner, key.scene, key.seed, results.grid.preset, str(result.status)]
        failure = result.message if result.status is CellStatus.FAILED else ""
        writer.writerow([*head, *(row.get(name, "") for name in keys), commit, failure])
    return text.getvalue()


def _scalars(report: Report, within: str = "") -> dict[str, str | int | float]:
    scalars: dict[str, str | int | float] = {}
    for key, value in report.items():
        if isinstance(value, Mapping):
            scalars |= _scalars(value, f"{within}{key}.")
        elif value is None:
            scalars[within + key] = ""
        elif not isinstance(value, Sequence) or isinstance(value, str):
            scalars[within + key] = value
    return scalars

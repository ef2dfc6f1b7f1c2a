"""Everything that a grid's folder holds besides its cells, written anew from these alone."""

from __future__ import annotations

from pathlib import Path
from typing import Final, get_args

from hgs_core.benchmark.planners.cell import CellStatus, scene_file_name, write_text
from hgs_core.benchmark.planners.curve_charts import Axis, curve_chart
from hgs_core.benchmark.planners.latex import latex
from hgs_core.benchmark.planners.markdown import markdown
from hgs_core.benchmark.planners.pictures import draw_missing, draw_sheet
from hgs_core.benchmark.planners.references import read_references
from hgs_core.benchmark.planners.results import GridResults, results_csv
from hgs_core.benchmark.planners.shortfalls import shortfalls
from hgs_core.benchmark.planners.tables import all_tables

CURVES: Final = "curves"


def write_outputs(root: Path) -> GridResults:
    """`results.csv`, `tables.md`, `tables.tex`, `shortfalls.md`, `curves/` and `trajectories/` of the grid in
    `root`.

    Where `references/` holds a scene's path of full knowledge, paths are also given as multiples of it.
    Raises `ConfigError` where `root` holds no grid, or a file of a cell is damaged.
    """
    results = GridResults.read(root)
    write_text(root / "results.csv", results_csv(results))
    write_text(root / "shortfalls.md", shortfalls(results) + "\n")
    draw_missing(results)
    pictures = []
    for scene in results.grid.scenes:
        pictures += _write_curves(results, scene)
        sheet = draw_sheet(results, scene)
        pictures += [] if sheet is None else [str(sheet.relative_to(root))]
    tables, lead = all_tables(results, read_references(root, results.grid)), _lead(results)
    write_text(root / "tables.md", markdown("Planners compared", lead, tables, pictures))
    write_text(root / "tables.tex", latex(lead, tables))
    return results


def _write_curves(results: GridResults, scene: str) -> list[str]:
    written = []
    for axis in get_args(Axis):
        name = f"{CURVES}/{scene_file_name(scene)}-{axis.partition('_')[0]}.svg"
        chart = curve_chart(results, scene, axis)
        if chart is None:
            (results.root / name).unlink(missing_ok=True)
            continue
        (results.root / CURVES).mkdir(exist_ok=True)
        write_text(results.root / name, chart)
        written.append(name)
    return written


def _lead(results: GridResults) -> list[str]:
    """What a reader must know to read the tables."""
    finished, asked = results.counted(CellStatus.FINISHED), len(results.cells)
    state = f"{finished} of {asked} missions finished"
    failed = results.counted(CellStatus.FAILED)
    if failed:
        state += f", {failed} failed"
    if asked - finished - failed:
        state += f", {asked - finished - failed} unfinished"
    settings = ", ".join(f"{key}={value}" for key, value in results.grid.overrides.items())
    preset = f"preset {results.grid.preset}" + (f" with {settings}" if settings else "")
    lead = [
        f"{state}; {preset}. Numbers are means over seeds ± sample standard deviation. A mission that is "
        "missing is named in brackets and fills no mean; bold is the best value of a scene among planners "
        "whose seeds are all there.",
        "Acc: mean distance of all Gaussian centres to the true surface. Comp and C.R.: mean distance of the "
        "true surface to the nearest centre, and the share of it within 5 cm; observable: of what any "
        "reachable camera pose can see. T_VE and T_P: medians over a mission's planning cycles of the time "
        "to evaluate viewpoints and of the whole cycle (wall time). P.L.: length of the path.",
        _machines(results),
        _areas(results),
    ]
    return [line for line in lead if line]


def _machines(results: GridResults) -> str:
    records = [
        one.record for one in results.cells.values() if one.record is not None and one.report is not None
    ]
    if not records:
        return ""
    processors = ", ".join(sorted({str(record.processor) for record in records}))
    beside = ", ".join(map(str, sorted({record.cells_at_once for record in records})))
    return f"Times were taken on {processors}; missions beside each other: {beside}."


def _areas(results: GridResults) -> str:
    lengths = {scene: results.area_length_m(scene) for scene in results.grid.scenes}
    told = [f"{scene} {length:.1f} m" for scene, length in lengths.items() if length > 0]
    if not told:
        return "No mission has a completion curve: paths to a completion and areas are not known."
    lacking = sorted(
        str(one.key)
        for one in results.cells.values()
        if one.report is not None and not one.report.get("completion_curve")
    )
    note = f" Without a completion curve: {'; '.join(lacking)}." if lacking else ""
    return (
        "Area: mean observable completion ratio over the way, from the start to the longest way of any "
        f"mission on the scene ({', '.join(told)}), the final ratio held after a mission's end.{note}"
    )

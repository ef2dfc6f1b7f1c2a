"""`hgs bench planners`: a grid of missions that compares planners; `hgs bench tables`: its tables again."""

from __future__ import annotations

import re
from contextlib import closing
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.console import ERRORS, OUTPUT
from app.cli.exit_codes import ExitCode
from app.cli.interrupts import InterruptCommands
from app.cli.run import parse_settings

if TYPE_CHECKING:
    from rich.status import Status

    from hgs_core.benchmark.planners.cell import CellResult
    from hgs_core.benchmark.planners.engine import Engine
    from hgs_core.benchmark.planners.estimate import GridProgress
    from hgs_core.benchmark.planners.results import GridResults


class EngineName(StrEnum):
    PROCESSES = "processes"
    RAY = "ray"


def planners(
    out: Annotated[Path, typer.Option(help="Folder of the grid; the same again goes on with it.")],
    scenes: Annotated[
        list[str] | None,
        typer.Option(
            help="house, building, warren, NAME:SEED, NAME:FIRST-LAST, or a mesh file; may be repeated, or "
            "a list by commas."
        ),
    ] = None,
    planners: Annotated[
        list[str] | None,
        typer.Option(
            help="Planner presets, likewise; `hgs presets` lists them.",
            show_default="the paper's seven, and best",
        ),
    ] = None,
    seeds: Annotated[list[str] | None, typer.Option(help="Likewise.", show_default="0,1")] = None,
    preset: Annotated[str, typer.Option(help="Mission preset of all missions.")] = "bench",
    jobs: Annotated[
        int | None,
        typer.Option(
            min=1, help="Missions beside each other.", show_default="processors / threads a mission"
        ),
    ] = None,
    engine: Annotated[EngineName, typer.Option(help="Where missions run.")] = EngineName.PROCESSES,
    address: Annotated[
        str, typer.Option(help="Of the Ray cluster: auto, local (a Ray of its own) or HOST:PORT.")
    ] = "auto",
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change a setting of the preset; may be repeated."),
    ] = None,
    redo: Annotated[
        bool, typer.Option("--redo", help="Run finished missions again whose settings were others.")
    ] = False,
    reference: Annotated[
        bool,
        typer.Option(
            "--reference", help="First find each scene's path of full knowledge, to compare with (a minute)."
        ),
    ] = False,
    tables_only: Annotated[
        bool,
        typer.Option("--tables-only", help="Run nothing: tables of what is there, as `hgs bench tables`."),
    ] = False,
) -> None:
    """Run every planner on every scene with every seed, and leave the paper's tables, curves and pictures.

    Missions that are finished are kept, so that the same command goes on after an interruption; Ctrl-C ends
    at once and loses nothing that is finished. A mission that fails is marked and tried again by the next
    call.

    Exit codes:
    0 - all missions are finished;
    2 - an option, preset or scene is wrong, or finished missions had other settings;
    4 - some missions failed;
    130 - it was interrupted.
    """
    from hgs_core.benchmark.planners.outputs import write_outputs

    if tables_only:
        _tell(write_outputs(out))
        return
    if not scenes:
        raise typer.BadParameter("name at least one", param_hint="--scenes")
    from hgs_core.benchmark.planners.grid import GridRequest, plan_cells
    from hgs_core.benchmark.planners.references import write_references
    from hgs_core.benchmark.planners.roster import COMPARED
    from hgs_core.benchmark.planners.run import run_grid
    from hgs_core.mission.config import resolve_mission_config

    request = GridRequest(
        scenes=every_seed(listed(scenes)),
        planners=listed(planners or list(COMPARED)),
        seeds=_numbers(listed(seeds or ["0", "1"])),
        preset=preset,
        overrides=parse_settings(settings or []),
        out=out,
    )
    with ERRORS.status("opening the scenes") as opening:
        cells = plan_cells(request, progress=opening.update)
        if reference:
            config = resolve_mission_config(request.preset, request.overrides)
            scenes_once = list({cell.scene.name: cell.scene for cell in cells}.values())
            write_references(out, scenes_once, config, progress=opening.update)
    threads = max(cell.threads for cell in cells)
    with closing(_engine(engine, address, threads, jobs)) as chosen, ERRORS.status("starting") as status:
        teller = _Teller(status)
        with InterruptCommands(teller.say) as commands:
            stopped = run_grid(
                request,
                cells,
                chosen,
                observer=teller,
                commands=commands,
                write_outputs=lambda: write_outputs(out),
                redo=redo,
            )
    results = write_outputs(out)
    _tell(results)
    if stopped:
        ERRORS.print("interrupted: nothing finished is lost; the same command goes on", style="yellow")
        raise typer.Exit(ExitCode.INTERRUPTED)
    wanted = [results.cells[cell.key] for cell in cells]
    raise typer.Exit(ExitCode.COMPLETE if all(one.report is not None for one in wanted) else ExitCode.FAILED)


def tables(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder of `hgs bench planners`.")],
) -> None:
    """Write a grid's results.csv, tables, curves and pictures again, from its missions alone.

    Exit codes: 0 done, 2 the folder holds no grid.
    """
    from hgs_core.benchmark.planners.outputs import write_outputs

    with ERRORS.status("writing tables and pictures"):
        results = write_outputs(folder)
    _tell(results)


class _Teller:
    """A line for every mission that ended, and a moving one for what is under way."""

    def __init__(self, status: Status) -> None:
        self._status = status

    def say(self, message: str) -> None:
        ERRORS.print(message, style="yellow")

    def cell_ended(self, result: CellResult, progress: GridProgress) -> None:
        done = progress.done + progress.failed
        style = "red" if result.report is None else ""
        ERRORS.print(
            f"[{done}/{progress.asked}] {result.key}: {_result_line(result)}{_rest(progress)}",
            style=style,
            markup=False,
            highlight=False,
            soft_wrap=True,
        )

    def waiting(self, progress: GridProgress) -> None:
        running = ", ".join(f"{key.scene}/{key.planner}-{key.seed}" for key in progress.running)
        self._status.update(f"{progress.done} done, {progress.left} left{_rest(progress)}: {running}")


def _result_line(result: CellResult) -> str:
    from hgs_core.benchmark.planners.results import number_at

    if result.report is None:
        return f"{result.status}: {result.message}"
    parts = [str(result.report.get("stop_reason")).replace("_", " ")]
    for key, form, words in (
        ("path_length_m", ".1f", "{} m"),
        ("completion_ratio_observable", ".3f", "observable ratio {}"),
        ("completion_cm_observable", ".2f", "completion {} cm"),
        ("accuracy_cm", ".2f", "accuracy {} cm"),
        ("wall_s", ".0f", "{} s"),
    ):
        value = number_at(result.report, key)
        parts.append(words.format("-" if value is None else f"{value:{form}}"))
    return ", ".join(parts)


def _rest(progress: GridProgress) -> str:
    left_s = progress.left_s()
    if not progress.left or left_s is None:
        return ""
    minutes = round(left_s / 60)
    rest = f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"
    return f"; about {rest} left" if minutes else "; less than a minute left"


def _engine(name: EngineName, address: str, threads: int, jobs: int | None) -> Engine:
    if name is EngineName.RAY:
        from hgs_core.benchmark.planners.ray_engine import RayEngine

        return RayEngine(address, threads=threads, slots=jobs)
    from hgs_core.benchmark.planners.engine import ProcessEngine, default_slots

    return ProcessEngine(jobs or default_slots(threads))


def listed(values: list[str]) -> list[str]:
    """`a,b` and `c` as a, b, c."""
    return [part.strip() for value in values for part in value.split(",") if part.strip()]


def every_seed(scenes: list[str]) -> list[str]:
    """`house:0-2` as house:0, house:1, house:2."""
    every = []
    for scene in scenes:
        span = re.fullmatch(r"([a-z]+):(\d{1,6})-(\d{1,6})", scene)
        if span is None:
            every.append(scene)
            continue
        first, last = int(span[2]), int(span[3])
        if last < first:
            raise typer.BadParameter(f"{scene}: {last} comes before {first}", param_hint="--scenes")
        every += [f"{span[1]}:{seed}" for seed in range(first, last + 1)]
    return every


def _numbers(values: list[str]) -> list[int]:
    for value in values:
        if not value.isdecimal():
            raise typer.BadParameter(f"{value!r} is not a seed: 0, 1, 2, ...", param_hint="--seeds")
    return [int(value) for value in values]


def _tell(results: GridResults) -> None:
    finished = sum(one.report is not None for one in results.cells.values())
    OUTPUT.print(
        f"{finished} of {len(results.cells)} missions finished; tables: {results.root / 'tables.md'}, "
        f"{results.root / 'tables.tex'}, figures: {results.root / 'results.csv'}",
        highlight=False,
        soft_wrap=True,
    )

"""`hgs bench paths`: how a car's ways are found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from app.cli.bench import JsonFile, Settings, write_figures
from app.cli.bench_planners import every_seed, listed
from app.cli.console import ERRORS, OUTPUT
from app.cli.run import parse_settings

if TYPE_CHECKING:
    from hgs_core.benchmark.paths import PathBenchmark, Spread

_SCENES = ["house:0-9", "warren:0-9"]


def paths(
    scenes: Annotated[
        list[str] | None,
        typer.Option(
            help="house, building, warren, NAME:SEED, NAME:FIRST-LAST, or a mesh file; may be repeated, or "
            "a list by commas.",
            show_default=",".join(_SCENES),
        ),
    ] = None,
    pairs: Annotated[int, typer.Option(min=1, help="Starts and goals, over all scenes.")] = 1000,
    robot: Annotated[str, typer.Option(help="Robot preset of a car.")] = "ackermann",
    seed: Annotated[int, typer.Option(min=0, help="Of the starts and goals.")] = 0,
    settings: Settings = None,
    json: JsonFile = None,
) -> None:
    """Ask for a car's way between random poses of fully known scenes: how many are found, how long they are
    beside A*'s of a robot that turns on the spot, how tight their turns are and what a query takes.

    Scenes are seen whole and drawn into the planner's own grid; --set changes the preset `paper`'s search
    (`planner.kinodynamic.heuristic_weight=1`) and robot (`robot.max_steering_deg=25`). Times depend on what
    else the machine does. Exit codes: 0 measured, 2 an option, preset or scene is wrong.
    """
    overrides = {"robot": robot, **parse_settings(settings or [])}
    from hgs_core.benchmark.paths import run_path_benchmark
    from hgs_core.mission.config import resolve_mission_config
    from hgs_core.native import kernels
    from hgs_core.robot.ackermann import AckermannConfig

    config = resolve_mission_config("paper", overrides)
    if not isinstance(config.robot, AckermannConfig):
        raise typer.BadParameter(
            f"{robot} is no car: its drive is {config.robot.drive}", param_hint="--robot"
        )
    kernels.set_threads(config.threads)
    with ERRORS.status("opening the scenes") as status:
        figures = run_path_benchmark(
            every_seed(listed(scenes or _SCENES)),
            pairs=pairs,
            seed=seed,
            car=config.robot,
            navigation=config.planner.navigation,
            search=config.planner.kinodynamic,
            progress=status.update,
        )
    _print(figures)
    write_figures(figures, json)


def _print(figures: PathBenchmark) -> None:
    OUTPUT.print(
        f"{figures.pairs:,} pairs in {len(figures.scenes)} scenes: a way for {figures.found:,} "
        f"({figures.found / figures.pairs:.1%}), for {figures.found_within_reach:,} of "
        f"{figures.within_reach:,} whose goal the car can come to; {figures.touching} ways touch anything; "
        f"{figures.threads} threads, {figures.variant}",
        highlight=False,
        soft_wrap=True,
    )
    for missed in figures.missed:
        OUTPUT.print(f"no way found in {missed}", highlight=False, soft_wrap=True)
    if figures.tightest_turn_share is not None:
        OUTPUT.print(
            f"the tightest turn: {figures.tightest_turn_share:.3f} of the car's limit", highlight=False
        )
    table = Table("", "median", "95th percentile", "largest")
    for name, spread, form in (
        ("length / A*'s of a disc", figures.length_to_astar, ".2f"),
        ("length m", figures.length_m, ".1f"),
        ("changes of gear", figures.gear_changes, ".0f"),
        ("a query that finds a way, ms", figures.query_ms, ".1f"),
        ("a query that finds none, ms", figures.failed_query_ms, ".1f"),
        ("all poses within reach of a start, ms", figures.reach_ms, ".1f"),
    ):
        table.add_row(name, *_cells(spread, form))
    OUTPUT.print(table)


def _cells(spread: Spread | None, form: str) -> list[str]:
    if spread is None:
        return ["-"] * 3
    return [f"{value:{form}}" for value in (spread.median, spread.p95, spread.max)]

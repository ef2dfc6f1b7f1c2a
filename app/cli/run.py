"""`hgs run`: one mission from a preset to a folder of results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.console import ERRORS, OUTPUT
from app.cli.exit_codes import ExitCode, exit_code_of
from app.cli.interrupts import InterruptCommands
from app.cli.progress import MissionProgress
from app.cli.report_table import report_table
from hgs_core.mission.clock import ClockKind

if TYPE_CHECKING:
    from hgs_core.mission.request import MissionRequest


def run(
    scene: Annotated[
        str,
        typer.Option(
            help="house, building, NAME:SEED, a mesh file (.glb, .gltf, .obj, .ply) or the folder of a scan; "
            "`hgs scenes` lists what there is."
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder for the results; must be absent or empty.")],
    preset: Annotated[str, typer.Option(help="Mission preset; `hgs presets` lists them.")] = "paper",
    planner: Annotated[
        str | None,
        typer.Option(help="Another planner than the preset's; `hgs presets` lists them.", show_default=False),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same trajectory (lockstep clock).")] = 0,
    max_time: Annotated[
        float | None, typer.Option(min=0.0, metavar="S", help="Mission time in seconds after which to stop.")
    ] = None,
    clock: Annotated[
        ClockKind | None,
        typer.Option(
            help="lockstep: mission time is counted, and the same seed gives the same mission; real: it is "
            "wall time, and mapper and planner must keep up with the robot.",
            show_default="the preset's, lockstep",
        ),
    ] = None,
    region: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json",
            help="Only what lies in this outline is worth seeing: [[x, y], ...] in metres.",
            show_default=False,
        ),
    ] = None,
    no_go: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json",
            help="No part of the robot enters these areas: a list of outlines, [[[x, y], ...], ...].",
            show_default=False,
        ),
    ] = None,
    extend: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Begin with the maps of a finished run of the same scene and sensors: only what is missing "
            "is visited.",
            show_default=False,
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change a setting of the preset; may be repeated."),
    ] = None,
) -> None:
    """Run one mission: explore, map, evaluate, and leave a folder of results.

    Ctrl-C ends the mission in order: the folder is complete, with stop_reason "interrupted". After a crash,
    `hgs resume` goes on from the last checkpoint.

    Exit codes:
    0 - the mission is complete;
    2 - an option, preset or scene is wrong, and nothing was run;
    3 - the mission ended before all was seen (time limit, path budget, or stuck);
    4 - the mission failed on its way, or its folder could not be written;
    130 - it was interrupted.
    """
    overrides = parse_settings(settings or [])
    for option, name, file in (("--region", "region", region), ("--no-go", "no_go", no_go)):
        if file is not None:
            overrides[f"directives.{name}"] = _json_in(file, option)
    from hgs_core.mission import run as mission  # takes seconds to import: not for --help and wrong options

    request = mission.MissionRequest(
        scene=scene,
        preset=preset,
        planner=planner,
        seed=seed,
        out=out,
        max_time_s=max_time,
        overrides=overrides,
        clock=str(clock) if clock is not None else None,
        extends=extend,
    )
    raise typer.Exit(run_and_tell(request))


def run_and_tell(request: MissionRequest) -> ExitCode:
    """Run the mission in sight of the operator, whose Ctrl-C stops it."""
    from hgs_core.mission import run as mission

    progress = MissionProgress(ERRORS)
    with progress, InterruptCommands(progress.say) as commands:
        report = mission.run_mission(request, observer=progress, commands=commands)
    assert report is not None, "nobody suspends a mission from here"
    OUTPUT.print(report_table(report))
    OUTPUT.print(f"results: {request.out}", highlight=False, soft_wrap=True)
    return exit_code_of(report.stop_reason)


def _json_in(file: Path, option: str) -> str:
    """The JSON in a file, as the value of a setting; what it says is checked with the other settings."""
    try:
        return json.dumps(json.loads(file.read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise typer.BadParameter(f"{file} cannot be read as JSON: {error}", param_hint=option) from error


def parse_settings(settings: list[str]) -> dict[str, str]:
    """`key=value` texts as a mapping. A text without `=` or a key given twice is a usage error."""
    overrides: dict[str, str] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        key = key.strip()
        if not equals or not key:
            raise typer.BadParameter(f"{setting!r} is not KEY=VALUE", param_hint="--set")
        if key in overrides:
            raise typer.BadParameter(f"{key} is set twice", param_hint="--set")
        overrides[key] = value.strip()
    return overrides

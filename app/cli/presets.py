"""`hgs presets`: which mission presets there are, and what one resolves to."""

from __future__ import annotations

from typing import Annotated

import typer
import yaml
from rich.table import Table

from app.cli.console import OUTPUT
from app.cli.run import parse_settings
from hgs_core.config.presets import load_preset, preset_names


def presets(
    name: Annotated[str | None, typer.Argument(help="Show every setting of this preset.")] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="As in `hgs run`: show what it changes."),
    ] = None,
) -> None:
    """List mission presets and planners, or print every setting of a preset: the keys that `--set` takes."""
    if name is None:
        if settings:
            raise typer.BadParameter("name the preset that it changes", param_hint="--set")
        _list("mission", "preset")
        _list("planner", "planner (--planner)")
        return
    from hgs_core.mission.config import resolve_mission_config

    resolved = resolve_mission_config(name, parse_settings(settings or []))
    text = yaml.safe_dump(resolved.model_dump(mode="json"), sort_keys=False, allow_unicode=True)
    typer.echo(text, nl=False)


def _list(subject: str, heading: str) -> None:
    table = Table(heading, "what it is")
    for name in preset_names(subject):
        table.add_row(name, str(load_preset(subject, name).get("description", "")))
    OUTPUT.print(table)

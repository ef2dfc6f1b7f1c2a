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
    """List the mission presets, or print every setting of one: the keys that `--set` takes."""
    if name is None:
        if settings:
            raise typer.BadParameter("name the preset that it changes", param_hint="--set")
        table = Table("preset", "what it is")
        for preset in preset_names("mission"):
            table.add_row(preset, str(load_preset("mission", preset).get("description", "")))
        OUTPUT.print(table)
        return
    from hgs_core.mission.config import resolve_mission_config

    resolved = resolve_mission_config(name, parse_settings(settings or []))
    text = yaml.safe_dump(resolved.model_dump(mode="json"), sort_keys=False, allow_unicode=True)
    typer.echo(text, nl=False)

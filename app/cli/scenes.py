"""`hgs scenes`: which scenes there are, and the facts of a given one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from app.cli.console import ERRORS, OUTPUT
from app.cli.exit_codes import ExitCode
from app.cli.run import parse_settings
from hgs_core.errors import HgsError
from hgs_core.scene.built_in import BUILT_IN_SCENES
from hgs_core.scene.registry import scene_names, scene_sources

if TYPE_CHECKING:
    from hgs_core.scene.options import SceneOptions
    from hgs_core.scene.scene import Scene


def scenes(
    sources: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SCENE]...",
            help="Names, mesh files or folders of scans to look at; none lists what there is.",
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="How they are placed, as `hgs run --set scene.KEY=VALUE` does it.",
        ),
    ] = None,
) -> None:
    """List the scenes that there are, or show what a mission would find in the given ones.

    Exit codes: 0 every scene can serve, 2 one cannot (the reason is printed, the others are shown).
    """
    if not sources:
        table = Table("scene", "what it is")
        for name, what in scene_names().items():
            if name in BUILT_IN_SCENES:
                table.add_row(name, f"built in, made from a seed: {what}")
                table.add_row(f"{name}:SEED", f"another layout, e.g. {name}:7")
            else:
                table.add_row(name, what)
        for kind in scene_sources().values():
            if not kind.names:
                table.add_row("FILE" if kind.general else "FOLDER", kind.opens)
        OUTPUT.print(table)
        return
    options = _options(settings or [])
    from hgs_core.scene.scene import open_scene

    refused = 0
    for source in sources:
        try:
            scene = open_scene(source, options)
        except HgsError as error:
            ERRORS.print(f"{source}: {error}", style="red", markup=False, highlight=False, soft_wrap=True)
            refused += 1
        else:
            OUTPUT.print(scene_table(source, scene))
    if refused:
        raise typer.Exit(ExitCode.USAGE)


def _options(settings: list[str]) -> SceneOptions:
    """`KEY=VALUE` or `scene.KEY=VALUE`, as a mission takes them."""
    from hgs_core.mission.config import changed

    overrides = {
        f"scene.{key.removeprefix('scene.')}": text for key, text in parse_settings(settings).items()
    }
    return changed({"description": "no mission"}, overrides, source="--set").scene


def scene_table(source: str, scene: Scene) -> Table:
    """Size, detail, start and notices of one scene."""
    mesh, bounds, start = scene.mesh, scene.bounds, scene.start
    textures = {id(m.texture): m.texture for m in mesh.materials if m.texture is not None}
    megapixels = sum(texture.shape[0] * texture.shape[1] for texture in textures.values()) / 1e6
    size = " x ".join(f"{extent:.2f}" for extent in bounds.size_m)
    lower = ", ".join(f"{value:.2f}" for value in bounds.lower_m)
    upper = ", ".join(f"{value:.2f}" for value in bounds.upper_m)
    table = Table(title=source, title_justify="left", show_header=False)
    table.add_row("size", f"{size} m")
    table.add_row("bounds", f"({lower}) .. ({upper}) m, floor at z = 0")
    table.add_row("surface", f"{mesh.areas_m2.sum():.0f} m², {len(mesh.triangles):,} triangles")
    table.add_row("materials", f"{len(mesh.materials)}, with {len(textures)} textures ({megapixels:.1f} Mpx)")
    table.add_row(
        "start", f"({start.x_m:.2f}, {start.y_m:.2f}) m, heading {math.degrees(start.yaw_rad):.0f} degrees"
    )
    for notice in scene.notices:
        table.add_row("notice", notice)
    return table

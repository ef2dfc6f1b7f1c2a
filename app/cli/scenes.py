"""`hgs scenes`: which scenes there are, and the facts of a given one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from app.cli.console import ERRORS, OUTPUT
from app.cli.exit_codes import ExitCode
from hgs_core.errors import HgsError
from hgs_core.scene.built_in import BUILT_IN_SCENES

if TYPE_CHECKING:
    from hgs_core.scene.scene import Scene


def scenes(
    sources: Annotated[
        list[str] | None,
        typer.Argument(metavar="[SCENE]...", help="Names or mesh files to look at; none lists the built-in."),
    ] = None,
) -> None:
    """List the built-in scenes, or show what a mission would find in the given ones.

    Exit codes: 0 every scene can serve, 2 one cannot (the reason is printed, the others are shown).
    """
    if not sources:
        table = Table("scene", "what it is")
        for name, what in BUILT_IN_SCENES.items():
            table.add_row(name, f"built in, made from a seed: {what}")
            table.add_row(f"{name}:SEED", f"another layout, e.g. {name}:7")
        table.add_row("FILE", "any textured mesh: .glb, .gltf, .obj, .ply")
        OUTPUT.print(table)
        return
    from hgs_core.scene.scene import open_scene

    refused = 0
    for source in sources:
        try:
            scene = open_scene(source)
        except HgsError as error:
            ERRORS.print(f"{source}: {error}", style="red", markup=False, highlight=False, soft_wrap=True)
            refused += 1
        else:
            OUTPUT.print(scene_table(source, scene))
    if refused:
        raise typer.Exit(ExitCode.USAGE)


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

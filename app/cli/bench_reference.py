"""`hgs bench reference`: how far one who knew the scene would drive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from app.cli.bench import JsonFile, Settings
from app.cli.console import ERRORS, OUTPUT
from app.cli.run import parse_settings

if TYPE_CHECKING:
    from hgs_core.evaluation.full_knowledge import FullKnowledgePath


def reference(
    scene: Annotated[str, typer.Option(help="house, building, NAME:SEED, or a mesh file.")],
    preset: Annotated[str, typer.Option(help="Mission preset, for its camera and robot.")] = "paper",
    level: Annotated[
        list[float] | None,
        typer.Option(min=0.01, max=1.0, help="Share of the observable surface to see; may be repeated."),
    ] = None,
    settings: Settings = None,
    json: JsonFile = None,
) -> None:
    """Find short paths that see 90, 95 and 97 % of what can be observed of a scene that is fully known.

    A mission's path length at a completion ratio can be stated as a multiple of them. They are the shortest
    that a search finds, not lower bounds; looking around costs no length. A minute or two a scene, cached.

    Exit codes: 0 found, 2 an option, preset or scene is wrong, or a level is more than can be seen.
    """
    overrides = parse_settings(settings or [])
    from hgs_core.evaluation.full_knowledge import LEVELS, full_knowledge_path
    from hgs_core.mission.ceiling import ceiling_request
    from hgs_core.mission.config import resolve_mission_config
    from hgs_core.native import kernels
    from hgs_core.scene.scene import open_scene

    config = resolve_mission_config(preset, overrides)
    kernels.set_threads(config.threads)
    with ERRORS.status(f"opening {scene}") as status:
        world = open_scene(scene, radius_m=config.robot.radius_m, height_m=config.robot.height_m)
        request = ceiling_request(config, (world.start.x_m, world.start.y_m))
        found = full_knowledge_path(world.caster, request, levels=level or LEVELS, progress=status.update)
    _print(world.name, found)
    if json is not None:
        json.write_text(found.model_dump_json(indent=2) + "\n", encoding="utf-8")
        OUTPUT.print(f"paths: {json}", highlight=False, soft_wrap=True)


def _print(scene: str, found: FullKnowledgePath) -> None:
    OUTPUT.print(
        f"{scene}: {found.n_samples:,} of {found.n_observable:,} observable samples, of which "
        f"{found.n_places:,} places see {found.visible_share:.1%}",
        highlight=False,
        soft_wrap=True,
    )
    table = Table("observable surface seen", "path", "looks besides straight ahead")
    for route in found.routes:
        table.add_row(f"{route.level:.0%}", f"{route.length_m:.1f} m", str(len(route.looks)))
    OUTPUT.print(table)

"""`hgs mesh`: a surface mesh from the keyframes of a finished run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.cli.console import ERRORS, OUTPUT


def mesh(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder that `hgs run` left behind.")],
    out: Annotated[Path | None, typer.Option(help="File to write; by default DIR/mesh.ply.")] = None,
    voxel_size: Annotated[
        float, typer.Option(min=0.002, max=1.0, help="Edge of a voxel [m]: smaller is finer, and slower.")
    ] = 0.02,
    truncation: Annotated[
        float, typer.Option(min=1.0, help="How near to a surface its depth counts, in voxels.")
    ] = 4.0,
    min_observations: Annotated[
        int,
        typer.Option(min=1, help="Keyframes that must have seen a place: more is cleaner, with more holes."),
    ] = 1,
) -> None:
    """Fuse the depth of a run's keyframes into a triangle mesh with coloured vertices.

    Reads transforms.json and keyframes/; `hgs evaluate DIR` then measures DIR/mesh.ply as well. Halving the
    voxels takes eight times as long: 0.02 suits rooms, 0.01 furniture.

    Exit codes: 0 done, 2 the folder is not a run's, or its keyframes show no surface.
    """
    from hgs_core.errors import MapError
    from hgs_core.mapping.keyframe_archive import KeyframeArchive
    from hgs_core.mapping.mesh_file import write_mesh
    from hgs_core.mapping.volume_fusion import MeshConfig, fuse_mesh

    config = MeshConfig(
        voxel_size_m=voxel_size, truncation_voxels=truncation, min_observations=min_observations
    )
    keyframes = KeyframeArchive.open(folder)
    with ERRORS.status("fusing keyframes") as status:
        fused = fuse_mesh(keyframes, config, progress=status.update)
    if len(fused.triangles) == 0:
        raise MapError(f"the {len(keyframes)} keyframes of {folder} show no surface with these settings")
    path = out or folder / "mesh.ply"
    write_mesh(fused, path)
    OUTPUT.print(
        f"{path} ({len(fused.vertices_m):,} vertices, {len(fused.triangles):,} triangles)",
        highlight=False,
        soft_wrap=True,
    )

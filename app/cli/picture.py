"""`hgs picture`: a finished run's map from above, with the way that the robot took."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.cli.console import OUTPUT


def picture(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder that `hgs run` left behind.")],
    out: Annotated[
        Path | None, typer.Option(help="Image file to write; by default DIR/top_view.png.")
    ] = None,
    width: Annotated[int, typer.Option(min=100, max=8000, help="Width of the image [pixels].")] = 1200,
    cut_height: Annotated[
        float, typer.Option(min=0.1, help="Leave out what lies higher than this [m], above all the ceiling.")
    ] = 2.0,
) -> None:
    """Draw a run's map from above, without its ceiling, and the trajectory on it.

    Exit codes: 0 done, 2 the folder is not a run's.
    """
    from PIL import Image

    from hgs_core.evaluation.top_view import top_view
    from hgs_core.evaluation.trajectory import read_trajectory
    from hgs_core.gaussians.ply import read_ply

    trajectory = read_trajectory(folder / "trajectory.txt")
    image = top_view(
        read_ply(folder / "map.ply"),
        trajectory.poses.translation,
        width_px=width,
        cut_height_m=cut_height,
    )
    path = out or folder / "top_view.png"
    Image.fromarray(image).save(path)
    OUTPUT.print(f"{path} ({image.shape[1]} x {image.shape[0]} pixels)", highlight=False)

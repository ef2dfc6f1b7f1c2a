"""What the colours and marks of the 3D scene mean, in words."""

from __future__ import annotations

from app.missions.display import MAX_VOXELS, VOXEL_REACH_M
from app.viewer.palette import (
    CAMERA,
    GLOBAL_TOUR,
    LOCAL_PATH,
    NO_GO,
    REGION,
    REJECTED,
    RGB,
    ROADMAP,
    SUBSPACE,
    TRAJECTORY,
    VOXEL,
    css,
)
from hgs_core.evaluation.colour_maps import ramp


def legend_html(min_splat_m: float, max_splats: int) -> str:
    ramp_colours = [css(_rgb(row)) for row in (90, 145, 200, 255)]
    all_colours = [css(_rgb(row)) for row in (0, 64, 128, 192, 255)]
    rows = [
        _row(_line(TRAJECTORY), "driven path"),
        _row(_line(LOCAL_PATH), "local path, being driven"),
        _row(_line(GLOBAL_TOUR), "global tour, still to come"),
        _row(_line(CAMERA), "robot and camera"),
        _row(_tile(SUBSPACE["reconstructed"]), "subspace reconstructed"),
        _row(_tile(SUBSPACE["reconstructing"]), "subspace under way"),
        _row(_tile(SUBSPACE["unreconstructed"]), "subspace not yet seen"),
        _row(
            f'<span style="{_BOX}background:linear-gradient(90deg,{",".join(ramp_colours)})"></span>',
            "candidate view: gain, low to high",
        ),
        _row(_tile(REJECTED), "candidate rejected"),
        _row(_line(REGION), "region of interest"),
        _row(_tile(NO_GO), "no-go area (hatched)"),
        _row(_line(ROADMAP), "roadmap"),
        _row(_tile(VOXEL["occupied"]), "voxel: surface"),
        _row(_tile(VOXEL["frontier"]), "voxel: frontier of what is known"),
        _row(_tile(VOXEL["missing"]), "voxel: missing"),
        _row(
            f'<span style="{_BOX}background:linear-gradient(90deg,{",".join(all_colours)})"></span>',
            "uncertainty: known well to never seen, three decades",
        ),
    ]
    note = (
        f"Splats are drawn at no less than {min_splat_m * 1000:.0f} mm radius; of more than {max_splats:,} "
        f"Gaussians every k-th is shown, enlarged. Voxels are those within "
        f"{VOXEL_REACH_M:.0f} m of the robot, at most {MAX_VOXELS:,}."
    )
    return (
        f'<div style="padding:0 1em 0.6em;font-size:0.8em;line-height:1.55">{"".join(rows)}'
        f'<div style="margin-top:0.5em;opacity:0.7;line-height:1.35">{note}</div></div>'
    )


_BOX = "display:inline-block;width:1.6em;height:0.75em;border-radius:2px;flex:none;"


def _row(mark: str, text: str) -> str:
    return f'<div style="display:flex;align-items:center;gap:0.6em">{mark}<span>{text}</span></div>'


def _line(colour: RGB) -> str:
    style = f"display:inline-block;width:1.6em;height:3px;flex:none;background:{css(colour)}"
    return f'<span style="{style}"></span>'


def _tile(colour: RGB) -> str:
    return f'<span style="{_BOX}background:{css(colour)}"></span>'


def _rgb(row: int) -> RGB:
    red, green, blue = (int(channel) for channel in ramp()[row])
    return red, green, blue

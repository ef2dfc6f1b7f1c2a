"""`curves/SCENE-path.svg` and `SCENE-time.svg`: how completion grows with the way driven, and with time."""

from __future__ import annotations

from typing import Final, Literal

import numpy as np

from hgs_core.benchmark.planners.curve import CompletionCurve, held
from hgs_core.benchmark.planners.results import GridResults
from hgs_core.benchmark.planners.roster import BEST, COMPARED
from hgs_core.evaluation.band_chart import Band, band_chart

_SAMPLES: Final = 400
_LABELS: Final = {"path_m": "path driven (m)", "time_s": "mission time (s)"}

Axis = Literal["path_m", "time_s"]


def curve_chart(results: GridResults, scene: str, axis: Axis) -> str | None:
    """An SVG of every planner's mean over its finished seeds; None where no mission has a curve.

    A mission that ended counts on with its final completion until the longest of its planner ends.
    """
    bands, missing = [], []
    for planner in results.grid.planners:
        curves = results.curves(planner, scene)
        asked = len(results.of(planner, scene))
        if curves:
            seeds = "" if len(curves) == asked else f" [{len(curves)} of {asked}]"
            bands.append(_band(f"{planner}{seeds}", style_of(results, planner), curves, axis))
        elif asked:
            missing.append(planner)
    if not bands:
        return None
    subtitle = f"preset {results.grid.preset}; line: mean over seeds, band: their range, dots: missions' ends"
    if missing:
        subtitle += f"; no curve yet: {', '.join(missing)}"
    return band_chart(
        f"{scene}: observable completion ratio (5 cm)",
        bands,
        subtitle=subtitle,
        x_label=_LABELS[axis],
        y_label="completion ratio, observable surface",
        upper_part=(0.8, 1.0),
        marks=(0.90, 0.95),
    )


def style_of(results: GridResults, planner: str) -> int:
    """The same for a planner in every chart of a grid, and for the paper's planners in all grids; the two
    that all others are compared with have the solid lines."""
    return list(dict.fromkeys(("paper", BEST.preset, *COMPARED, *results.grid.planners))).index(planner)


def _band(name: str, style: int, curves: list[CompletionCurve], axis: Axis) -> Band:
    columns = [getattr(curve, axis) for curve in curves]
    x = np.linspace(0.0, max(float(column[-1]) for column in columns), _SAMPLES)
    ratios = np.stack([held(column, one.ratio, x) for column, one in zip(columns, curves, strict=True)])
    ends = np.array([[column[-1], one.ratio[-1]] for column, one in zip(columns, curves, strict=True)])
    return Band(
        name=name,
        style=style,
        x=x,
        mean=ratios.mean(axis=0),
        lower=ratios.min(axis=0),
        upper=ratios.max(axis=0),
        ends=ends,
    )

"""A line chart as inline SVG: no script, colours from the page it stands in."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.evaluation.chart_axes import number, ticks

_WIDTH: Final = 600
_HEIGHT: Final = 260
_LEFT: Final = 62
_RIGHT: Final = 12
_TOP: Final = 30
_BOTTOM: Final = 42
_MAX_POINTS: Final = 600
"""More points than this cannot be told apart at the chart's width."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Series:
    """One line; where `y` is NaN the line is broken."""

    name: str
    x: Float[ndarray, " n"]
    y: Float[ndarray, " n"]


def line_chart(title: str, series: Sequence[Series], *, x_label: str, y_label: str) -> str:
    """The series over common axes, the y axis from 0 where nothing lies below.

    A chart without a single finite point says so instead.
    """
    shown = [_finite(one) for one in series]
    if not any(len(one.x) for one in shown):
        return f'<figure class="chart"><figcaption>{escape(title)}: not measured</figcaption></figure>'
    x_ticks = ticks(min(one.x.min() for one in shown if len(one.x)), _largest(one.x for one in shown))
    y_ticks = ticks(min(0.0, *(one.y.min() for one in shown if len(one.y))), _largest(o.y for o in shown))
    parts = [
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{escape(title)}">',
        f'<text class="title" x="{_LEFT}" y="16">{escape(title)}</text>',
    ]
    for tick in y_ticks:
        y = _y(tick, y_ticks)
        parts.append(f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text class="tick end" x="{_LEFT - 6}" y="{y + 4:.1f}">{number(tick)}</text>')
    for tick in x_ticks:
        x = _x(tick, x_ticks)
        parts.append(f'<text class="tick middle" x="{x:.1f}" y="{_HEIGHT - 24}">{number(tick)}</text>')
    middle = (_LEFT + _WIDTH - _RIGHT) / 2
    parts.append(f'<text class="tick middle" x="{middle}" y="{_HEIGHT - 6}">{escape(x_label)}</text>')
    parts.append(f'<text class="tick end" x="{_WIDTH - _RIGHT}" y="16">{escape(y_label)}</text>')
    for index, one in enumerate(series):
        parts.append(f'<path class="line line{index}" d="{_path(one, x_ticks, y_ticks)}"/>')
        if len(series) > 1:
            at = _TOP + 14 + 16 * index
            parts.append(f'<text class="key key{index} end" x="{_WIDTH - _RIGHT - 6}" y="{at}">')
            parts.append(f"{escape(one.name)}</text>")
    return f'<figure class="chart">{"".join(parts)}</svg></figure>'


def _finite(one: Series) -> Series:
    kept = np.isfinite(one.x) & np.isfinite(one.y)
    return Series(name=one.name, x=one.x[kept], y=one.y[kept])


def _largest(columns: Iterable[Float[ndarray, " n"]]) -> float:
    return max(float(column.max()) for column in columns if len(column))


def _x(value: float, ticks: Float[ndarray, " n"]) -> float:
    share = (value - ticks[0]) / (ticks[-1] - ticks[0])
    return float(_LEFT + share * (_WIDTH - _LEFT - _RIGHT))


def _y(value: float, ticks: Float[ndarray, " n"]) -> float:
    share = (value - ticks[0]) / (ticks[-1] - ticks[0])
    return float(_HEIGHT - _BOTTOM - share * (_HEIGHT - _BOTTOM - _TOP))


def _path(one: Series, x_ticks: Float[ndarray, " n"], y_ticks: Float[ndarray, " m"]) -> str:
    kept = np.unique(np.linspace(0, len(one.x) - 1, min(len(one.x), _MAX_POINTS)).round().astype(int))
    commands, pen_down = [], False
    for x, y in zip(one.x[kept], one.y[kept], strict=True):
        if not (np.isfinite(x) and np.isfinite(y)):
            pen_down = False
            continue
        commands.append(f"{'L' if pen_down else 'M'}{_x(x, x_ticks):.1f} {_y(y, y_ticks):.1f}")
        pen_down = True
    return "".join(commands)

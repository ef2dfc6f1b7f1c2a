"""Curves with bands as an SVG file of its own: a whole view, and beside it one of its upper part.

No two curves share both colour and dash. The colours are those of Okabe and Ito, which are told apart with
any kind of colour vision, with grey in place of their yellow, too pale on white.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.evaluation.chart_axes import number, ticks

_COLOURS: Final = ("#000000", "#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7f7f7f")
_DASHES: Final = ("9 3", "2.5 2.5", "9 3 2 3", "18 4", "14 4 2 4 2 4")
_WIDTH: Final = 1250
_HEIGHT: Final = 560
_PANEL_WIDTH: Final = 440
_LEFT: Final = 58
_BETWEEN: Final = 62
_TOP: Final = 58
_BOTTOM: Final = 52
_KEY_LEFT: Final = _LEFT + 2 * _PANEL_WIDTH + _BETWEEN + 18
_STYLE: Final = (
    "text{font:13px system-ui,sans-serif;fill:#1c1f26}.title{font-size:17px;font-weight:600}"
    ".faint{fill:#5c6370}.end{text-anchor:end}.middle{text-anchor:middle}.grid{stroke:#e3e5e9}"
    ".mark{stroke:#9aa0ab;stroke-dasharray:1.5 3}.frame{fill:none;stroke:#9aa0ab}"
    ".curve{fill:none;stroke-width:2;stroke-linejoin:round}.band{opacity:0.13}"
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Band:
    """A curve, what lies around it, and where single missions ended."""

    name: str
    style: int
    """Which colour and dash: the same number has the same in every chart; 0 and 1 are solid lines."""
    x: Float[ndarray, " n"]
    mean: Float[ndarray, " n"]
    lower: Float[ndarray, " n"]
    upper: Float[ndarray, " n"]
    ends: Float[ndarray, "n_ends 2"]
    """x and y."""


@dataclass(frozen=True, kw_only=True)
class _Panel:
    """A rectangle of the picture and the part of the plane that it shows."""

    left: float
    x_ticks: Float[ndarray, " n"]
    y_ticks: Float[ndarray, " m"]

    def x(self, value: Float[ndarray, " k"]) -> Float[ndarray, " k"]:
        return self.left + (value - self.x_ticks[0]) / (self.x_ticks[-1] - self.x_ticks[0]) * _PANEL_WIDTH

    def y(self, value: Float[ndarray, " k"]) -> Float[ndarray, " k"]:
        share = (value - self.y_ticks[0]) / (self.y_ticks[-1] - self.y_ticks[0])
        return _HEIGHT - _BOTTOM - share * (_HEIGHT - _BOTTOM - _TOP)


def band_chart(
    title: str,
    bands: Sequence[Band],
    *,
    subtitle: str,
    x_label: str,
    y_label: str,
    upper_part: tuple[float, float],
    marks: Sequence[float],
) -> str:
    """Curves of shares (0 to 1) over x: on the left all of them, on the right their part between the two
    values `upper_part`. Lines at the values `marks`.
    """
    if not bands:
        raise ValueError("a chart needs at least one curve")
    x_ticks = ticks(0.0, max(float(band.x.max()) for band in bands))
    whole = _Panel(left=_LEFT, x_ticks=x_ticks, y_ticks=np.linspace(0.0, 1.0, 6))
    n_steps = round((upper_part[1] - upper_part[0]) / 0.05)
    part = _Panel(
        left=_LEFT + _PANEL_WIDTH + _BETWEEN, x_ticks=x_ticks, y_ticks=np.linspace(*upper_part, n_steps + 1)
    )
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" '
        f'height="{_HEIGHT}" role="img" aria-label="{escape(title)}">',
        f'<style>{_STYLE}</style><rect width="{_WIDTH}" height="{_HEIGHT}" fill="#ffffff"/>',
        f'<text class="title" x="{_LEFT}" y="22">{escape(title)}</text>',
        f'<text class="faint" x="{_LEFT}" y="42">{escape(subtitle)}</text>',
    ]
    for index, panel in enumerate((whole, part)):
        parts += _axes(panel, x_label, y_label if index == 0 else "", marks)
        parts += _clipped(panel, index, bands)
    parts += _key(bands)
    return "".join(parts) + "</svg>\n"


def _axes(panel: _Panel, x_label: str, y_label: str, marks: Sequence[float]) -> list[str]:
    right, bottom = panel.left + _PANEL_WIDTH, _HEIGHT - _BOTTOM
    parts = []
    for value, y in zip(panel.y_ticks, panel.y(panel.y_ticks), strict=True):
        parts.append(f'<line class="grid" x1="{panel.left}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text class="faint end" x="{panel.left - 7}" y="{y + 4:.1f}">{number(value)}</text>')
    for value, x in zip(panel.x_ticks, panel.x(panel.x_ticks), strict=True):
        parts.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{_TOP}" y2="{bottom}"/>')
        parts.append(f'<text class="faint middle" x="{x:.1f}" y="{bottom + 18}">{number(value)}</text>')
    for y in panel.y(np.array(marks, dtype=float)):
        parts.append(f'<line class="mark" x1="{panel.left}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>')
    middle = panel.left + _PANEL_WIDTH / 2
    parts.append(f'<text class="middle" x="{middle}" y="{bottom + 40}">{escape(x_label)}</text>')
    if y_label:
        at = f'x="14" y="{(_TOP + bottom) / 2}" transform="rotate(-90 14 {(_TOP + bottom) / 2})"'
        parts.append(f'<text class="middle" {at}>{escape(y_label)}</text>')
    return parts


def _clipped(panel: _Panel, index: int, bands: Sequence[Band]) -> list[str]:
    """The curves, cut at the panel's edges."""
    box = f'x="{panel.left}" y="{_TOP}" width="{_PANEL_WIDTH}" height="{_HEIGHT - _BOTTOM - _TOP}"'
    parts = [f'<clipPath id="panel{index}"><rect {box}/></clipPath><g clip-path="url(#panel{index})">']
    for band in bands:
        outline_x = np.concatenate([band.x, band.x[::-1]])
        outline_y = np.concatenate([band.upper, band.lower[::-1]])
        outline = _points(panel, outline_x, outline_y)
        parts.append(f'<path class="band" fill="{_colour(band)}" d="M{outline}Z"/>')
    for band in bands:
        dash = f' stroke-dasharray="{_dash(band)}"' if _dash(band) else ""
        line = _points(panel, band.x, band.mean)
        parts.append(f'<path class="curve" stroke="{_colour(band)}"{dash} d="M{line}"/>')
    for band in bands:
        for x, y in zip(panel.x(band.ends[:, 0]), panel.y(band.ends[:, 1]), strict=True):
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{_colour(band)}" stroke="#ffffff"/>')
    return [*parts, f'</g><rect class="frame" {box}/>']


def _points(panel: _Panel, x: Float[ndarray, " n"], y: Float[ndarray, " n"]) -> str:
    return "L".join(f"{px:.1f} {py:.1f}" for px, py in zip(panel.x(x), panel.y(y), strict=True))


def _key(bands: Sequence[Band]) -> list[str]:
    parts = []
    for index, band in enumerate(bands):
        y = _TOP + 12 + 24 * index
        dash = f' stroke-dasharray="{_dash(band)}"' if _dash(band) else ""
        parts.append(
            f'<path class="curve" stroke="{_colour(band)}"{dash} d="M{_KEY_LEFT} {y}L{_KEY_LEFT + 44} {y}"/>'
            f'<text x="{_KEY_LEFT + 52}" y="{y + 4}">{escape(band.name)}</text>'
        )
    return parts


def _colour(band: Band) -> str:
    return _COLOURS[band.style % len(_COLOURS)]


def _dash(band: Band) -> str:
    return "" if band.style < 2 else _DASHES[band.style % len(_DASHES)]

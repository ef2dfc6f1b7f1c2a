"""A self-contained page: style, pictures and charts inline, no script, no network."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from html import escape
from typing import Final

from jaxtyping import UInt8
from numpy import ndarray
from PIL import Image

_JPEG_QUALITY: Final = 85

_STYLE: Final = """
:root { color-scheme: light dark; --ink: #1c1f26; --faint: #5c6370; --paper: #ffffff; --panel: #f4f5f7;
  --edge: #d9dce1; --a: #2b6a99; --b: #c2571a; }
@media (prefers-color-scheme: dark) { :root { --ink: #e8e9ec; --faint: #a2a8b4; --paper: #15171c;
  --panel: #1e2128; --edge: #353a44; --a: #6fb3e0; --b: #f0955a; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 24px; max-width: 1232px; background: var(--paper); color: var(--ink);
  font: 15px/1.5 system-ui, sans-serif; }
h1 { font-size: 26px; margin: 0 0 4px; } h2 { font-size: 19px; margin: 36px 0 8px; }
h3 { font-size: 16px; margin: 20px 0 6px; } p { max-width: 80ch; margin: 6px 0; }
.lead { color: var(--faint); } .wide { width: 100%; }
table { border-collapse: collapse; width: 100%; } th { text-align: left; font-weight: 600; }
td, th { padding: 4px 12px 4px 0; border-bottom: 1px solid var(--edge); vertical-align: top; }
td.value { font-variant-numeric: tabular-nums; white-space: nowrap; text-align: right; }
td.meaning { color: var(--faint); }
.grid2 { display: grid; grid-template-columns: repeat(auto-fit, minmax(440px, 1fr)); gap: 12px; }
.views { display: grid; grid-template-columns: repeat(auto-fit, minmax(340px, 1fr)); gap: 10px; }
figure { margin: 0; background: var(--panel); border: 1px solid var(--edge); border-radius: 6px; padding: 8px;
  break-inside: avoid; }
figure img, figure svg { display: block; width: 100%; height: auto; }
figcaption { color: var(--faint); font-size: 13px; margin-top: 4px; }
svg text { fill: var(--ink); font: 12px system-ui, sans-serif; } svg .title { font-size: 14px; }
svg .tick { fill: var(--faint); } svg .end { text-anchor: end; } svg .middle { text-anchor: middle; }
svg .grid { stroke: var(--edge); } svg .line { fill: none; stroke-width: 1.6; }
svg .line0 { stroke: var(--a); } svg .line1 { stroke: var(--b); } svg .key0 { fill: var(--a); }
svg .key1 { fill: var(--b); }
@media print { body { padding: 0; max-width: none; } h2 { break-after: avoid; } }
"""


def page(title: str, body: Sequence[str]) -> str:
    """A whole HTML document."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(body)
        + "\n</body>\n</html>\n"
    )


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Rows of a name, a value and what it means; texts are escaped here."""
    classes = ("name", "value", "meaning")
    heads = "".join(f"<th>{escape(text)}</th>" for text in head)
    lines = [
        "".join(f'<td class="{css}">{escape(text)}</td>' for css, text in zip(classes, row, strict=True))
        for row in rows
    ]
    return f"<table><tr>{heads}</tr>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"


def picture(image: UInt8[ndarray, "height width 3"], caption: str) -> str:
    """A figure with the image inside the page."""
    stream = io.BytesIO()
    Image.fromarray(image).save(stream, "JPEG", quality=_JPEG_QUALITY)
    data = base64.b64encode(stream.getvalue()).decode("ascii")
    return (
        f'<figure><img alt="{escape(caption)}" src="data:image/jpeg;base64,{data}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def paragraph(text: str, css: str = "") -> str:
    return f'<p class="{css}">{escape(text)}</p>' if css else f"<p>{escape(text)}</p>"


def heading(text: str, level: int = 2) -> str:
    return f"<h{level}>{escape(text)}</h{level}>"


def group(css: str, items: Sequence[str]) -> str:
    """Items laid out by the class `css`: `grid2` for charts, `views` for pictures."""
    return f'<div class="{css}">' + "".join(items) + "</div>"

"""The images of a view as files: what a browser shows, and what stays of a mission that has ended."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from PIL import Image

from app.missions.display import IMAGE_KINDS, DisplayView

_PHOTOGRAPHIC: Final = frozenset({"observed", "rendered"})
_JPEG_QUALITY: Final = 88


@dataclass(frozen=True, kw_only=True)
class Picture:
    sequence: int
    """Number of the view that it shows."""
    content: bytes
    media_type: str


def picture_of(view: DisplayView, sequence: int, kind: str) -> Picture:
    """`kind` of `IMAGE_KINDS`: camera images as JPEG, coloured figures as PNG."""
    stream = io.BytesIO()
    image = Image.fromarray(getattr(view, kind))
    if kind in _PHOTOGRAPHIC:
        image.save(stream, "JPEG", quality=_JPEG_QUALITY)
    else:
        image.save(stream, "PNG", compress_level=1)
    return Picture(sequence=sequence, content=stream.getvalue(), media_type=_media_type(kind))


def save_pictures(view: DisplayView, sequence: int, folder: Path) -> None:
    """Write every image of `view` into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    for kind in IMAGE_KINDS:
        temporary = folder / f"{kind}.partial"
        temporary.write_bytes(picture_of(view, sequence, kind).content)
        temporary.replace(folder / _file_name(kind))


def load_picture(folder: Path, sequence: int, kind: str) -> Picture | None:
    """The saved image, or None when there is none."""
    path = folder / _file_name(kind)
    if not path.is_file():
        return None
    return Picture(sequence=sequence, content=path.read_bytes(), media_type=_media_type(kind))


def _media_type(kind: str) -> str:
    return "image/jpeg" if kind in _PHOTOGRAPHIC else "image/png"


def _file_name(kind: str) -> str:
    return f"{kind}.jpg" if kind in _PHOTOGRAPHIC else f"{kind}.png"

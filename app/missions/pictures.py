"""The last view of a mission as a file, and the images of a view as a browser shows them."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from PIL import Image

from app.missions.display import DisplayView
from app.storage.data_dir import write_whole

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
        return Picture(sequence=sequence, content=stream.getvalue(), media_type="image/jpeg")
    image.save(stream, "PNG", compress_level=1)
    return Picture(sequence=sequence, content=stream.getvalue(), media_type="image/png")


def save_view(view: DisplayView, path: Path) -> None:
    """Write `view` down, whole or not at all."""
    meta = np.frombuffer(json.dumps(view.meta()).encode(), np.uint8)
    contents: dict[str, Any] = {"meta": meta, **view.arrays()}
    write_whole(path, lambda file: np.savez(file, **contents))


def load_view(path: Path) -> DisplayView | None:
    """The saved view, or None when there is none."""
    if not path.is_file():
        return None
    with np.load(path, allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    return DisplayView.of(arrays, json.loads(arrays.pop("meta").tobytes()))

"""Moments of a mission, kept so that a page can go back to them: images, map from above, plan.

One file a moment, written whole or not at all, below the mission's folder. There are never more than a stated
number of them: when there would be, every second one is let go and they are taken half as often from then on,
so a mission of any length is kept evenly.
"""

from __future__ import annotations

import io
import json
import logging
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from PIL import Image
from pydantic import Field

from app.missions.display import IMAGE_KINDS, DisplayView
from app.missions.top_view import top_view, top_view_facts
from app.storage.data_dir import write_whole
from hgs_core.config.base import StrictConfig

log = logging.getLogger(__name__)

_JPEG_QUALITY: Final = 85
_HEAD: Final = "moment.json"
_FACTS: Final = "top_view.json"
_TOP_VIEW: Final = "top_view.png"


class MomentSettings(StrictConfig):
    """How much of a mission's past is kept for looking at."""

    most: int = Field(120, ge=4, le=1_000)
    """Moments kept of one mission; each takes about 100 kB."""
    interval_s: float = Field(2.0, gt=0)
    """Mission time between two moments, at first [s]; it doubles whenever there are too many."""
    image_width: int = Field(480, ge=64)
    """Images of moments are no wider than this [px]."""


@dataclass(frozen=True, kw_only=True)
class Moment:
    number: int
    """1, 2, ... in the order in which they were taken; gaps where one was let go."""
    time_s: float
    """Mission time."""
    sequence: int
    """Number of the mission's newest event then."""
    path_length_m: float
    interval_s: float
    """Mission time until the next one is due."""


class MomentArchive:
    """The moments of one mission. One thread records; any may read."""

    def __init__(self, folder: Path, settings: MomentSettings, *, below_m: float) -> None:
        """`below_m`: what is higher is left out of the map from above."""
        self._folder = folder
        self._settings = settings
        self.below_m = below_m
        self._known: list[Moment] | None = None

    def all(self) -> list[Moment]:
        """In order."""
        return list(self._known) if self._known is not None else self._read_all()

    def is_due(self, time_s: float) -> bool:
        """Whether a view of that mission time is to be recorded: enough has passed, or the mission was set
        back to an earlier time."""
        known = self._recorded()
        return not known or not known[-1].time_s <= time_s < known[-1].time_s + known[-1].interval_s

    def record(self, view: DisplayView, *, sequence: int, path_length_m: float) -> None:
        """Keep `view`. Raises `OSError` where the disk takes no more."""
        known = self._recorded()
        last = known[-1] if known else None
        moment = Moment(
            number=last.number + 1 if last else 1,
            time_s=view.time_s,
            sequence=sequence,
            path_length_m=path_length_m,
            interval_s=last.interval_s if last else self._settings.interval_s,
        )
        if len(known) >= self._settings.most:
            moment = Moment(**{**asdict(moment), "interval_s": 2 * moment.interval_s})
            for dropped in known[1::2]:
                self._path(dropped.number).unlink(missing_ok=True)
            del known[1::2]
        contents = self._contents(moment, view)
        write_whole(self._path(moment.number), lambda file: _write(file, contents))
        known.append(moment)

    def find(self, number: int) -> Moment | None:
        head = self._member(number, _HEAD)
        return Moment(**json.loads(head)) if head is not None else None

    def facts(self, number: int) -> dict[str, Any] | None:
        """What belongs over the map from above, as `top_view_facts` tells it."""
        facts = self._member(number, _FACTS)
        return dict(json.loads(facts)) if facts is not None else None

    def image(self, number: int, kind: str) -> bytes | None:
        """A JPEG; `kind` of `IMAGE_KINDS`."""
        return self._member(number, f"{kind}.jpg")

    def top_view(self, number: int) -> bytes | None:
        """The map from above then, a PNG."""
        return self._member(number, _TOP_VIEW)

    def _recorded(self) -> list[Moment]:
        """The recorder's own list, read once: an earlier service may have begun it."""
        if self._known is None:
            self._known = self._read_all()
        return self._known

    def _read_all(self) -> list[Moment]:
        numbers = sorted(int(path.stem) for path in self._folder.glob("*.zip"))
        found = (self.find(number) for number in numbers)
        return [moment for moment in found if moment is not None]

    def _contents(self, moment: Moment, view: DisplayView) -> dict[str, bytes]:
        drawn = top_view(view, below_m=self.below_m)
        return {
            _HEAD: json.dumps(asdict(moment)).encode(),
            _FACTS: json.dumps(top_view_facts(view, drawn)).encode(),
            _TOP_VIEW: drawn.png(),
            **{f"{kind}.jpg": _jpeg(getattr(view, kind), self._settings.image_width) for kind in IMAGE_KINDS},
        }

    def _member(self, number: int, name: str) -> bytes | None:
        """None when there is no such moment, or it has just been let go."""
        try:
            with zipfile.ZipFile(self._path(number)) as stored:
                return stored.read(name)
        except FileNotFoundError:
            return None
        except (zipfile.BadZipFile, KeyError) as error:
            log.warning("%s is not a moment: %s", self._path(number), error)
            return None

    def _path(self, number: int) -> Path:
        return self._folder / f"{number:06d}.zip"


def _write(file: BinaryIO, contents: dict[str, bytes]) -> None:
    """Stored, not deflated: images are compressed already."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, content in contents.items():
            archive.writestr(name, content)


def _jpeg(pixels: np.ndarray, width: int) -> bytes:
    image = Image.fromarray(pixels)
    if image.width > width:
        image = image.resize((width, max(1, round(image.height * width / image.width))), Image.Resampling.BOX)
    stream = io.BytesIO()
    image.save(stream, "JPEG", quality=_JPEG_QUALITY)
    return stream.getvalue()

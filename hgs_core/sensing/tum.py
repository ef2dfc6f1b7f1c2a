"""Recorded RGB-D sequences in the TUM layout."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float32, UInt8
from numpy import ndarray
from PIL import Image, UnidentifiedImageError

from hgs_core.errors import ConfigError, SensorError, StreamError
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.lens import Distortion, LensCamera
from hgs_core.geometry.se3 import SE3
from hgs_core.sensing.image_codecs import depth_from_units
from hgs_core.sensing.raw_frame import RawFrame, nearest_index

_MAX_TIME_OFFSET_S = 0.02


@dataclass(frozen=True, kw_only=True)
class _Row:
    time_s: float
    fields: tuple[str, ...]
    where: str


class TumRecording:
    """A `FrameSource`: a folder with `rgb.txt`, `depth.txt`, `intrinsics.json` and, where poses are known,
    `groundtruth.txt` (timestamp tx ty tz qx qy qz qw).

    Each colour image is joined with the depth image and the pose nearest in time, at most 20 ms away; colour
    images without a depth image are left out (see `n_unmatched`), those without a pose have none. Colour and
    depth images are of one camera; `distortion_model` and `distortion` in `intrinsics.json` name its lens
    (`Distortion`). Raises `StreamError` naming file and line for anything malformed.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.name = folder.name
        self._camera, self._depth_scale = _read_intrinsics(folder / "intrinsics.json")
        colours = _read_rows(folder / "rgb.txt", n_fields=1)
        depths = _read_rows(folder / "depth.txt", n_fields=1)
        poses_file = folder / "groundtruth.txt"
        self.pose_origin = f"{poses_file}{'' if poses_file.is_file() else ' is missing'}"
        poses = _read_rows(poses_file, n_fields=7) if poses_file.is_file() else []
        joined = [(c, _nearest(depths, c.time_s), _nearest(poses, c.time_s)) for c in colours]
        self._rows = [(c, d, _pose(p)) for c, d, p in joined if d is not None]
        self.n_unmatched = len(colours) - len(self._rows)
        if not self._rows:
            raise StreamError(
                f"{folder}: no colour image has a depth image within {_MAX_TIME_OFFSET_S} s of it"
            )
        self.timestamps_s = np.array([colour.time_s for colour, _, _ in self._rows])
        self.is_posed = np.array([pose is not None for _, _, pose in self._rows])

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[RawFrame]:
        for sequence, (colour, depth, pose) in enumerate(self._rows):
            yield RawFrame(
                rgb=self._read_rgb(colour),
                depth_m=self._read_depth(depth),
                colour_camera=self._camera,
                depth_camera=self._camera,
                T_colour_depth=SE3.identity(),
                T_world_camera=pose,
                timestamp_s=colour.time_s,
                sequence=sequence,
            )

    def _read_rgb(self, row: _Row) -> UInt8[ndarray, "h w 3"]:
        with self._open_image(row) as image:
            return np.asarray(image.convert("RGB"))

    def _read_depth(self, row: _Row) -> Float32[ndarray, "h w"]:
        with self._open_image(row) as image:
            raw = np.asarray(image)
        if raw.ndim != 2:
            raise StreamError(
                f"{row.where}: {row.fields[0]} has {raw.ndim} axes, expected a one-channel depth image"
            )
        return depth_from_units(raw, self._depth_scale)

    def _open_image(self, row: _Row) -> Image.Image:
        path, camera = self.folder / row.fields[0], self._camera.intrinsics
        try:
            image = Image.open(path)
            image.load()
        except FileNotFoundError as error:
            raise StreamError(f"{row.where}: {path} is missing") from error
        except (UnidentifiedImageError, OSError) as error:
            raise StreamError(f"{row.where}: {path} is not a readable image: {error}") from error
        if image.size != (camera.width, camera.height):
            raise StreamError(
                f"{row.where}: {row.fields[0]} measures {image.width} x {image.height} pixels, "
                f"the camera {camera.width} x {camera.height}"
            )
        return image


def _read_intrinsics(path: Path) -> tuple[LensCamera, float]:
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
        intrinsics = CameraIntrinsics(
            width=int(values["width"]),
            height=int(values["height"]),
            fx=float(values["fx"]),
            fy=float(values["fy"]),
            cx=float(values["cx"]),
            cy=float(values["cy"]),
        )
        distortion = Distortion.named(values.get("distortion_model", "none"), values.get("distortion", []))
        scale = float(values["depth_scale"])
    except FileNotFoundError as error:
        raise StreamError(f"{path} is missing: a sequence needs its camera's intrinsics") from error
    except json.JSONDecodeError as error:
        raise StreamError(f"{path}:{error.lineno}: not valid JSON: {error.msg}") from error
    except (KeyError, TypeError, ValueError, ConfigError) as error:
        raise StreamError(
            f"{path}: {error!r}; expected numbers width, height, fx, fy, cx, cy, "
            "depth_scale (units per metre), and of a lens distortion_model and distortion"
        ) from error
    if not scale > 0:
        raise StreamError(f"{path}: depth_scale is {scale}, expected units per metre above 0")
    return LensCamera(intrinsics=intrinsics, distortion=distortion), scale


def _read_rows(path: Path, *, n_fields: int) -> list[_Row]:
    """Rows in order of time; comments and empty lines are skipped."""
    if not path.is_file():
        raise StreamError(
            f"{path} is missing: expected rgb.txt, depth.txt, intrinsics.json and, for poses, groundtruth.txt"
        )
    rows = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        where = f"{path}:{number}"
        if len(words) != 1 + n_fields:
            raise StreamError(f"{where}: {len(words)} fields, expected a timestamp and {n_fields} more")
        rows.append(_Row(time_s=_number(words[0], where), fields=tuple(words[1:]), where=where))
    if not rows:
        raise StreamError(f"{path}: no rows")
    for before, after in pairwise(rows):
        if after.time_s <= before.time_s:
            raise StreamError(f"{after.where}: timestamp {after.time_s} is not after the row before")
    return rows


def _number(word: str, where: str) -> float:
    try:
        value = float(word)
    except ValueError:
        raise StreamError(f"{where}: {word!r} is not a number") from None
    if not np.isfinite(value):
        raise StreamError(f"{where}: {word!r} is not finite")
    return value


def _pose(row: _Row | None) -> SE3 | None:
    if row is None:
        return None
    tx, ty, tz, qx, qy, qz, qw = (_number(word, row.where) for word in row.fields)
    try:
        return SE3.from_quaternion_wxyz(np.array([qw, qx, qy, qz]), np.array([tx, ty, tz]))
    except SensorError as error:
        raise StreamError(f"{row.where}: {error}") from error


def _nearest(rows: list[_Row], time_s: float) -> _Row | None:
    index = nearest_index(np.array([row.time_s for row in rows]), time_s, _MAX_TIME_OFFSET_S)
    return None if index is None else rows[index]

"""Encoded colour and depth images, as bytes, to arrays."""

from __future__ import annotations

import io
from typing import Final

import numpy as np
from jaxtyping import Float32, Num, UInt8
from numpy import ndarray
from PIL import Image, UnidentifiedImageError

from hgs_core.errors import StreamError

_NO_RETURN: Final = (0, 65535)
"""Depths in units that sensors write where they measured nothing."""


def depth_from_units(
    raw: Num[ndarray, "height width"], units_per_m: float
) -> Float32[ndarray, "height width"]:
    """z-depth [m] of whole numbers of units; 0 and 65535 are no return (0)."""
    depth = raw.astype(np.float32) / np.float32(units_per_m)
    depth[np.isin(raw, _NO_RETURN)] = 0.0
    return depth


def depth_from_metres(raw: Num[ndarray, "height width"], where: str) -> Float32[ndarray, "height width"]:
    """z-depth [m] of floating-point images as ROS defines them (REP 117): NaN and -inf are no return (0),
    +inf is nothing within range. Raises `StreamError` for negative lengths.
    """
    depth = raw.astype(np.float32)
    depth[np.isnan(depth) | np.isneginf(depth)] = 0.0
    if (depth < 0).any():
        raise StreamError(f"{where}: depth of {float(depth.min())} m; expected metres above 0, or NaN")
    return depth


def decode_colour(data: bytes, where: str) -> UInt8[ndarray, "height width 3"]:
    """A JPEG or an 8 bit PNG as RGB. Raises `StreamError` for anything else."""
    image = _decoded(data, where, ("JPEG", "PNG"))
    if image.mode not in ("RGB", "RGBA", "L", "P"):
        raise StreamError(f"{where}: an image of mode {image.mode} is no 8 bit colour image")
    return np.asarray(image.convert("RGB"))


def decode_depth_png(data: bytes, where: str) -> Num[ndarray, "height width"]:
    """A 16 bit PNG of one channel, in units. Raises `StreamError` for anything else."""
    raw = np.asarray(_decoded(data, where, ("PNG",)))
    if raw.ndim != 2 or raw.dtype not in (np.uint16, np.int32):
        raise StreamError(f"{where}: {raw.dtype} of shape {raw.shape}; expected a 16 bit PNG of one channel")
    return raw.astype(np.uint16)


def _decoded(data: bytes, where: str, formats: tuple[str, ...]) -> Image.Image:
    try:
        image = Image.open(io.BytesIO(data), formats=formats)
        image.load()
    except (UnidentifiedImageError, Image.DecompressionBombError, OSError, SyntaxError, ValueError) as error:
        raise StreamError(
            f"{where}: {len(data)} bytes are no readable {' or '.join(formats)} image: {error}"
        ) from error
    return image

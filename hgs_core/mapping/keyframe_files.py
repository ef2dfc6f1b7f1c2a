"""The image files of a keyframe: `NNNNNN.jpg` and `NNNNNN_depth.png`.

Colour is a JPEG of quality 95 without chroma subsampling: its error stays near one grey level. Depth is a 16
bit PNG in units that its folder's `transforms.json` names; two of its values are no lengths.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from jaxtyping import Float32, UInt8, UInt16
from numpy import ndarray
from PIL import Image

from hgs_core.errors import MapError

FINEST_DEPTH_UNIT_M: Final = 1e-4
NO_RETURN: Final = 0
"""Depth value of a pixel that measured nothing."""
NOTHING_IN_RANGE: Final = 65535
"""Depth value of a pixel whose ray met nothing as far as the sensor (or the file) reaches."""
_FARTHEST: Final = 65534
_JPEG_QUALITY: Final = 95
_PNG_RUN_LENGTHS: Final = 3
"""zlib's Z_RLE: the last digits of a depth are noise, so longer matches only take longer and save nothing."""


def colour_name(index: int) -> str:
    return f"{index:06d}.jpg"


def depth_name(index: int) -> str:
    return f"{index:06d}_depth.png"


def depth_unit_m(range_m: float) -> float:
    """The finest unit in which 16 bits hold every depth of a sensor of that range, with a tenth to spare."""
    return max(FINEST_DEPTH_UNIT_M, 1.1 * range_m / _FARTHEST)


def encode_depth(depth_m: Float32[ndarray, "height width"], unit_m: float) -> UInt16[ndarray, "height width"]:
    """Depth as in `Frame` in units of `unit_m`; what is too far for 16 bits is `NOTHING_IN_RANGE`."""
    units = depth_m / np.float32(unit_m) + np.float32(0.5)
    return np.where(units < NOTHING_IN_RANGE, units, NOTHING_IN_RANGE).astype(np.uint16)


def decode_depth(encoded: UInt16[ndarray, "height width"], unit_m: float) -> Float32[ndarray, "height width"]:
    depth = encoded.astype(np.float32) * np.float32(unit_m)
    depth[encoded == NOTHING_IN_RANGE] = np.inf
    return depth


def write_colour(path: Path, rgb: UInt8[ndarray, "height width 3"]) -> None:
    Image.fromarray(rgb).save(path, "JPEG", quality=_JPEG_QUALITY, subsampling="4:4:4")


def write_depth(path: Path, encoded: UInt16[ndarray, "height width"]) -> None:
    Image.fromarray(encoded).save(path, "PNG", compress_level=1, compress_type=_PNG_RUN_LENGTHS)


def read_colour(path: Path) -> UInt8[ndarray, "height width 3"]:
    """Raises `MapError` for a file that is missing or no colour image."""
    image = _read(path)
    if image.ndim != 3 or image.dtype != np.uint8:
        raise MapError(f"{path} holds {image.dtype} {image.shape}; an RGB image is expected")
    return image


def read_depth(path: Path) -> UInt16[ndarray, "height width"]:
    """Raises `MapError` for a file that is missing or no 16 bit image of one channel."""
    image = _read(path)
    if image.ndim != 2 or image.dtype != np.uint16:
        raise MapError(f"{path} holds {image.dtype} {image.shape}; a 16 bit depth image is expected")
    return image


def _read(path: Path) -> ndarray:
    try:
        with Image.open(path) as image:
            return np.asarray(image)
    except OSError as error:
        raise MapError(f"cannot read the keyframe image {path}: {error}") from error

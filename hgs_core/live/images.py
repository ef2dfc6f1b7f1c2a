"""Colour and depth images as they travel. What a header says of its size is held against the camera before
anything is unpacked: a few bytes may stand for an image of any size."""

from __future__ import annotations

import io
from typing import Final

import numpy as np
from backports import zstd
from jaxtyping import Float32, UInt8
from numpy import ndarray
from PIL import Image, UnidentifiedImageError

from hgs_core.errors import StreamError
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.live.messages import Frame
from hgs_core.sensing.image_codecs import decode_colour, decode_depth_png

_NO_RETURN: Final = 0
_BEYOND_RANGE: Final = 65535
_JPEG_QUALITY: Final = 95


def decoded_colour(frame: Frame, camera: CameraIntrinsics) -> UInt8[ndarray, "height width 3"]:
    """Raises `StreamError` for what is no such image."""
    where = f"frame {frame.sequence}: colour"
    _require(frame.colour, frame.colour_format, camera, where)
    return decode_colour(frame.colour, where)


def decoded_depth(frame: Frame, camera: CameraIntrinsics) -> Float32[ndarray, "height width"]:
    """Z-depth [m]: 0 = no return, +inf = nothing within range. Raises `StreamError`."""
    where = f"frame {frame.sequence}: depth"
    if frame.depth_format == "zstd":
        raw = _unpacked(frame.depth, camera, where)
    else:
        _require(frame.depth, "png", camera, where)
        raw = decode_depth_png(frame.depth, where)
    depth = raw.astype(np.float32) / np.float32(frame.depth_scale)
    depth[raw == _NO_RETURN] = 0.0
    depth[raw == _BEYOND_RANGE] = np.inf
    return depth


def encoded_colour(rgb: UInt8[ndarray, "height width 3"], *, image_format: str = "jpeg") -> bytes:
    """JPEG of quality 95, or PNG."""
    packed = io.BytesIO()
    options = {"quality": _JPEG_QUALITY} if image_format == "jpeg" else {"compress_level": 1}
    Image.fromarray(rgb).save(packed, image_format, **options)
    return packed.getvalue()


def encoded_depth(
    depth_m: Float32[ndarray, "height width"], *, depth_format: str = "png", depth_scale: float = 1000.0
) -> bytes:
    """16 bits a pixel; depths that do not fit count as beyond the range."""
    scaled = np.where(np.isfinite(depth_m), depth_m, 0.0) * depth_scale
    raw = np.where(scaled < _BEYOND_RANGE, np.maximum(np.rint(scaled), depth_m > 0), _BEYOND_RANGE)
    raw = np.where(np.isinf(depth_m), _BEYOND_RANGE, raw).astype("<u2")
    if depth_format == "zstd":
        return zstd.compress(raw.tobytes(), level=1)
    packed = io.BytesIO()
    Image.fromarray(raw).save(packed, "png", compress_level=1)
    return packed.getvalue()


def _require(content: bytes, image_format: str, camera: CameraIntrinsics, where: str) -> None:
    """Look at the image's header alone. Raises `StreamError` for another format or size."""
    try:
        with Image.open(io.BytesIO(content), formats=[image_format.upper()]) as image:
            width, height = image.size
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise StreamError(f"{where}: no {image_format}: {error}") from None
    if (width, height) != (camera.width, camera.height):
        raise StreamError(
            f"{where}: an image of {width} x {height} pixels; the camera has {camera.width} x {camera.height}"
        )


def _unpacked(content: bytes, camera: CameraIntrinsics, where: str) -> ndarray:
    expected = camera.width * camera.height * 2
    unpacker = zstd.ZstdDecompressor()
    try:
        raw = unpacker.decompress(content, max_length=expected + 1)
    except zstd.ZstdError as error:
        raise StreamError(f"{where}: no zstd: {error}") from None
    if len(raw) != expected or not unpacker.eof:
        raise StreamError(
            f"{where}: does not unpack to {expected} bytes, "
            f"{camera.width} x {camera.height} pixels of 16 bits"
        )
    return np.frombuffer(raw, "<u2").reshape(camera.height, camera.width)

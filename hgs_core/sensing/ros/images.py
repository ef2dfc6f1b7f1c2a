"""`sensor_msgs/Image` and `sensor_msgs/CompressedImage`, colour and depth."""

from __future__ import annotations

import struct
from typing import Any, Final

import numpy as np
from jaxtyping import Float32, Num, UInt8
from numpy import ndarray

from hgs_core.errors import StreamError
from hgs_core.sensing.image_codecs import (
    decode_colour,
    decode_depth_png,
    depth_from_metres,
    depth_from_units,
)

IMAGE: Final = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE: Final = "sensor_msgs/msg/CompressedImage"

COLOUR_ENCODINGS: Final = ("rgb8", "bgr8", "rgba8", "bgra8", "mono8")
DEPTH_ENCODINGS: Final = ("16UC1", "mono16", "32FC1")
_CHANNELS: Final = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono8": 1}

_MM_PER_M: Final = 1000.0
"""Whole-number depth images are in millimetres (REP 118)."""
_DEPTH_HEADER: Final = struct.Struct("<iff")
"""Of compressedDepth: how it was compressed, and the two parameters of its quantisation."""


def is_depth(message: Any, where: str) -> bool:
    """Whether an image message holds depth. Raises `StreamError` for an encoding that is not known."""
    if hasattr(message, "format"):
        return "compressedDepth" in message.format
    if message.encoding in DEPTH_ENCODINGS:
        return True
    if message.encoding in COLOUR_ENCODINGS:
        return False
    known = ", ".join((*COLOUR_ENCODINGS, *DEPTH_ENCODINGS))
    raise StreamError(f"{where}: encoding {message.encoding!r} is not read; those that are: {known}")


def colour_image(message: Any, where: str) -> UInt8[ndarray, "height width 3"]:
    """RGB of an `Image` or a `CompressedImage` (JPEG, PNG). Raises `StreamError`."""
    if hasattr(message, "format"):
        if is_depth(message, where):
            raise StreamError(f"{where}: format {message.format!r} is depth; name a topic with colour images")
        return decode_colour(bytes(message.data), where)
    if message.encoding not in COLOUR_ENCODINGS:
        raise StreamError(
            f"{where}: encoding {message.encoding!r} is no colour; expected {', '.join(COLOUR_ENCODINGS)}"
        )
    channels = _CHANNELS[message.encoding]
    pixels = _rows(message, np.dtype(np.uint8), channels, where)
    if channels == 1:
        return np.repeat(pixels, 3, axis=2)
    rgb = pixels[..., :3] if message.encoding.startswith("rgb") else pixels[..., 2::-1]
    return np.ascontiguousarray(rgb)


def depth_image(message: Any, where: str) -> Float32[ndarray, "height width"]:
    """z-depth [m], 0 and +inf as in `Frame`, of an `Image` (16UC1 in millimetres, 32FC1 in metres) or of a
    `CompressedImage` of the transport compressedDepth. Raises `StreamError`."""
    if hasattr(message, "format"):
        return _compressed_depth(message.format, bytes(message.data), where)
    if message.encoding not in DEPTH_ENCODINGS:
        raise StreamError(
            f"{where}: encoding {message.encoding!r} is no depth; expected {', '.join(DEPTH_ENCODINGS)}"
        )
    if message.encoding == "32FC1":
        return depth_from_metres(_rows(message, np.dtype(np.float32), 1, where)[..., 0], where)
    return depth_from_units(_rows(message, np.dtype(np.uint16), 1, where)[..., 0], _MM_PER_M)


def _compressed_depth(form: str, data: bytes, where: str) -> Float32[ndarray, "height width"]:
    """A 12-byte header and a 16 bit PNG: millimetres, or inverse depth `A / depth + B` of 32FC1 images."""
    encoding, _, transport = (part.strip() for part in form.partition(";"))
    if not transport.startswith("compressedDepth"):
        raise StreamError(f"{where}: format {form!r} is no depth; expected '16UC1; compressedDepth' or 32FC1")
    if transport.split()[1:] not in ([], ["png"]):
        raise StreamError(
            f"{where}: format {form!r} is not read: record with compressedDepth's format png, or raw images"
        )
    if encoding not in ("16UC1", "32FC1"):
        raise StreamError(f"{where}: format {form!r} has the encoding {encoding!r}; expected 16UC1 or 32FC1")
    if len(data) <= _DEPTH_HEADER.size:
        raise StreamError(f"{where}: {len(data)} bytes are no compressedDepth: its header alone has 12")
    _, a, b = _DEPTH_HEADER.unpack_from(data)
    raw = decode_depth_png(data[_DEPTH_HEADER.size :], where)
    if encoding == "16UC1":
        return depth_from_units(raw, _MM_PER_M)
    if not (np.isfinite([a, b]).all() and a > 0):
        raise StreamError(f"{where}: quantisation A = {a}, B = {b}; expected finite numbers with A above 0")
    steps = raw.astype(np.float32) - np.float32(b)
    known = (raw != 0) & (steps > 0)
    return np.where(known, np.float32(a) / np.where(known, steps, np.float32(1)), np.float32(0.0))


def _rows(message: Any, dtype: np.dtype, channels: int, where: str) -> Num[ndarray, "height width channels"]:
    """The pixels of an uncompressed image, whose rows are `step` bytes apart."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    row_bytes = width * channels * dtype.itemsize
    data = bytes(message.data)
    if height < 1 or width < 1 or step < row_bytes or len(data) < height * step:
        raise StreamError(
            f"{where}: {len(data)} bytes in rows of {step} cannot hold {width} x {height} pixels "
            f"of {message.encoding}"
        )
    table = np.frombuffer(data, np.uint8, height * step).reshape(height, step)[:, :row_bytes]
    order = dtype.newbyteorder(">" if message.is_bigendian else "<")
    return np.ascontiguousarray(table).view(order).reshape(height, width, channels).astype(dtype)

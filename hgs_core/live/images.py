"""Colour and depth images as they travel. What a header says of its size is held against the camera before
anything is unpacked: a few bytes may stand for an image of any size."""

from __future__ import annotations

import io
from typing import Final

import cv2
import numpy as np
from backports import zstd
from jaxtyping import Float32, UInt8
from numpy import ndarray
from PIL import Image, UnidentifiedImageError

from hgs_core.errors import StreamError
from hgs_core.live.messages import CameraFacts, Frame

_NO_RETURN: Final = 0
_BEYOND_RANGE: Final = 65535
_PIL_NAMES: Final = {"jpeg": "JPEG", "png": "PNG"}
_JPEG_QUALITY: Final = 95


def decoded_colour(frame: Frame, camera: CameraFacts) -> UInt8[ndarray, "height width 3"]:
    """Raises `StreamError` for what is no such image."""
    _require_size(frame, frame.colour, frame.colour_format, camera, what="colour")
    image = cv2.imdecode(np.frombuffer(frame.colour, np.uint8), cv2.IMREAD_COLOR_RGB)
    if image is None:
        raise StreamError(f"frame {frame.sequence}: its colour image is broken: send it whole")
    return np.asarray(image, dtype=np.uint8)


def decoded_depth(frame: Frame, camera: CameraFacts) -> Float32[ndarray, "height width"]:
    """Z-depth [m]: 0 = no return, +inf = nothing within range. Raises `StreamError`."""
    if frame.depth_format == "zstd":
        raw = _unpacked(frame, camera)
    else:
        _require_size(frame, frame.depth, "png", camera, what="depth")
        image = cv2.imdecode(np.frombuffer(frame.depth, np.uint8), cv2.IMREAD_UNCHANGED)
        if image is None or image.dtype != np.uint16 or image.ndim != 2:
            raise StreamError(
                f"frame {frame.sequence}: its depth image is broken, or not one channel of 16 bits"
            )
        raw = np.asarray(image)
    depth = raw.astype(np.float32) / np.float32(frame.depth_scale)
    depth[raw == _NO_RETURN] = 0.0
    depth[raw == _BEYOND_RANGE] = np.inf
    return depth


def encoded_colour(rgb: UInt8[ndarray, "height width 3"], *, image_format: str = "jpeg") -> bytes:
    """JPEG of quality 95, or PNG."""
    options = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY] if image_format == "jpeg" else []
    done, content = cv2.imencode(f".{image_format}", rgb[..., ::-1], options)
    assert done
    return content.tobytes()


def encoded_depth(
    depth_m: Float32[ndarray, "height width"], *, depth_format: str = "png", depth_scale: float = 1000.0
) -> bytes:
    """16 bits a pixel; depths that do not fit count as beyond the range."""
    scaled = np.where(np.isfinite(depth_m), depth_m, 0.0) * depth_scale
    raw = np.where(scaled < _BEYOND_RANGE, np.maximum(np.rint(scaled), depth_m > 0), _BEYOND_RANGE)
    raw = np.where(np.isinf(depth_m), _BEYOND_RANGE, raw).astype(np.uint16)
    if depth_format == "zstd":
        return zstd.compress(raw.astype("<u2").tobytes(), level=1)
    done, content = cv2.imencode(".png", raw, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    assert done
    return content.tobytes()


def _require_size(frame: Frame, content: bytes, image_format: str, camera: CameraFacts, *, what: str) -> None:
    try:
        with Image.open(io.BytesIO(content), formats=[_PIL_NAMES[image_format]]) as image:
            size = image.size
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise StreamError(f"frame {frame.sequence}: its {what} image is no {image_format}: {error}") from None
    if size != (camera.width, camera.height):
        raise StreamError(
            f"frame {frame.sequence}: its {what} image measures {size[0]} x {size[1]} pixels, "
            f"the camera {camera.width} x {camera.height}"
        )


def _unpacked(frame: Frame, camera: CameraFacts) -> ndarray:
    expected = camera.width * camera.height * 2
    unpacker = zstd.ZstdDecompressor()
    try:
        content = unpacker.decompress(frame.depth, max_length=expected + 1)
    except zstd.ZstdError as error:
        raise StreamError(f"frame {frame.sequence}: its depth is no zstd: {error}") from None
    if len(content) != expected or not unpacker.eof:
        raise StreamError(
            f"frame {frame.sequence}: its depth does not unpack to {expected} bytes, "
            f"{camera.width} x {camera.height} pixels of 16 bits"
        )
    return np.frombuffer(content, "<u2").reshape(camera.height, camera.width)

"""`sensor_msgs/PointCloud2`."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from hgs_core.errors import StreamError

POINT_CLOUD: Final = "sensor_msgs/msg/PointCloud2"

_FLOATS: Final[dict[int, np.dtype]] = {7: np.dtype(np.float32), 8: np.dtype(np.float64)}
"""Of `sensor_msgs/PointField.datatype`."""


def points(message: Any, where: str) -> Float32[ndarray, "n 3"]:
    """x, y, z [m] of all points that are finite. Raises `StreamError` for a cloud without them, or one whose
    data is shorter than its header says."""
    fields = {field.name: field for field in message.fields}
    missing = [axis for axis in "xyz" if axis not in fields]
    if missing:
        raise StreamError(
            f"{where}: the cloud has no field {', '.join(missing)}; it has {', '.join(fields) or 'none'}"
        )
    height, width = int(message.height), int(message.width)
    point_step, row_step = int(message.point_step), int(message.row_step)
    data = bytes(message.data)
    if row_step < width * point_step or len(data) < height * row_step:
        raise StreamError(
            f"{where}: {len(data)} bytes in rows of {row_step} cannot hold {width} x {height} points "
            f"of {point_step} bytes"
        )
    table = np.frombuffer(data, np.uint8, height * row_step).reshape(height, row_step)
    rows = np.ascontiguousarray(table[:, : width * point_step]).reshape(height * width, point_step)
    axes = [_column(rows, fields[axis], bool(message.is_bigendian), where) for axis in "xyz"]
    cloud: Float32[ndarray, "n 3"] = np.stack(axes, axis=1)
    return cloud[np.isfinite(cloud).all(axis=1)]


def _column(rows: ndarray, field: Any, big_endian: bool, where: str) -> Float32[ndarray, " n"]:
    dtype = _FLOATS.get(int(field.datatype))
    if dtype is None:
        raise StreamError(
            f"{where}: field {field.name!r} has the datatype {field.datatype}; expected 7 (float32) or "
            "8 (float64)"
        )
    first, last = int(field.offset), int(field.offset) + dtype.itemsize
    if last > rows.shape[1]:
        raise StreamError(
            f"{where}: field {field.name!r} ends at byte {last} of points of {rows.shape[1]} bytes"
        )
    order = dtype.newbyteorder(">" if big_endian else "<")
    column = np.ascontiguousarray(rows[:, first:last]).view(order)[:, 0]
    return column.astype(np.float32)

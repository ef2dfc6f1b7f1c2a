"""MCAP files with ROS 2 messages, written by mcap's own writer."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
from mcap_ros2.writer import Writer
from PIL import Image

_TIME = "int32 sec\nuint32 nanosec\n"
_HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
_POINT = "float64 x\nfloat64 y\nfloat64 z\n"
_QUATERNION = "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
_POSE = "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
_ROI = "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"
_PARTS = {
    "builtin_interfaces/Time": _TIME,
    "std_msgs/Header": _HEADER,
    "geometry_msgs/Point": _POINT,
    "geometry_msgs/Vector3": _POINT,
    "geometry_msgs/Quaternion": _QUATERNION,
    "geometry_msgs/Pose": _POSE,
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance\n",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance\n",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
    ),
    "sensor_msgs/RegionOfInterest": _ROI,
    "sensor_msgs/PointField": "string name\nuint32 offset\nuint8 datatype\nuint32 count\n",
}
_TYPES = {
    "sensor_msgs/msg/Image": (
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n"
        "uint32 step\nuint8[] data\n"
    ),
    "sensor_msgs/msg/CompressedImage": "std_msgs/Header header\nstring format\nuint8[] data\n",
    "sensor_msgs/msg/CameraInfo": (
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\n"
        "float64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\n"
        "sensor_msgs/RegionOfInterest roi\n"
    ),
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
    "nav_msgs/msg/Odometry": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
        "geometry_msgs/TwistWithCovariance twist\n"
    ),
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "sensor_msgs/msg/PointCloud2": (
        "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n"
        "bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n"
    ),
}
_BETWEEN = "=" * 80


class Bag:
    """A file under construction: `with Bag(path) as bag: bag.add(topic, type, time_s, message)`."""

    def __init__(self, path: Path) -> None:
        self._writer = Writer(str(path))
        self._schemas: dict[str, Any] = {}

    def __enter__(self) -> Bag:
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.finish()

    def add(self, topic: str, kind: str, time_s: float, message: dict[str, Any]) -> None:
        if kind not in self._schemas:
            parts = [_TYPES[kind], *(f"MSG: {name}\n{text}" for name, text in _PARTS.items())]
            self._schemas[kind] = self._writer.register_msgdef(kind, f"{_BETWEEN}\n".join(parts))
        self._writer.write_message(topic, self._schemas[kind], message, log_time=round(1e9 * time_s))


def header(time_s: float, frame: str) -> dict[str, Any]:
    nanoseconds = round(1e9 * time_s)
    return {
        "stamp": {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9},
        "frame_id": frame,
    }


def image(time_s: float, pixels: np.ndarray, encoding: str, frame: str, padding: int = 0) -> dict[str, Any]:
    rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
    padded = np.pad(rows, ((0, 0), (0, padding)))
    return {
        "header": header(time_s, frame),
        "height": pixels.shape[0],
        "width": pixels.shape[1],
        "encoding": encoding,
        "is_bigendian": int(pixels.dtype.byteorder == ">"),
        "step": padded.shape[1],
        "data": padded.tobytes(),
    }


def compressed(time_s: float, data: bytes, form: str, frame: str) -> dict[str, Any]:
    return {"header": header(time_s, frame), "format": form, "data": data}


def encoded(pixels: np.ndarray, form: str) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, form, **({"quality": 95} if form == "JPEG" else {}))
    return buffer.getvalue()


def compressed_depth(pixels: np.ndarray, a: float = 0.0, b: float = 0.0) -> bytes:
    return struct.pack("<iff", 0, a, b) + encoded(pixels, "PNG")


def camera_info(
    time_s: float,
    size: tuple[int, int],
    focal_px: float,
    frame: str,
    *,
    model: str = "plumb_bob",
    d: tuple[float, ...] = (0.0,) * 5,
) -> dict[str, Any]:
    """Of a camera whose principal point is the centre of its image, (width - 1) / 2 as ROS counts."""
    width, height = size
    k = [focal_px, 0, (width - 1) / 2, 0, focal_px, (height - 1) / 2, 0, 0, 1]
    return {
        "header": header(time_s, frame),
        "height": height,
        "width": width,
        "distortion_model": model,
        "d": list(d),
        "k": k,
        "r": np.eye(3).ravel().tolist(),
        "p": [*k[:3], 0, *k[3:6], 0, *k[6:], 0],
        "binning_x": 0,
        "binning_y": 0,
        "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
    }


def pose(translation: tuple[float, float, float], yaw_rad: float = 0.0) -> dict[str, Any]:
    return {"position": _xyz(translation), "orientation": _turned(yaw_rad)}


def pose_stamped(
    time_s: float, translation: tuple[float, float, float], yaw_rad: float = 0.0
) -> dict[str, Any]:
    return {"header": header(time_s, "map"), "pose": pose(translation, yaw_rad)}


def odometry(time_s: float, child: str, translation: tuple[float, float, float]) -> dict[str, Any]:
    still = {"linear": _xyz((0, 0, 0)), "angular": _xyz((0, 0, 0))}
    return {
        "header": header(time_s, "odom"),
        "child_frame_id": child,
        "pose": {"pose": pose(translation), "covariance": [0.0] * 36},
        "twist": {"twist": still, "covariance": [0.0] * 36},
    }


def transforms(time_s: float, *edges: tuple[str, str, tuple[float, float, float], float]) -> dict[str, Any]:
    """Of (parent, child, translation, yaw)."""
    return {
        "transforms": [
            {
                "header": header(time_s, parent),
                "child_frame_id": child,
                "transform": {"translation": _xyz(translation), "rotation": _turned(yaw_rad)},
            }
            for parent, child, translation, yaw_rad in edges
        ]
    }


def point_cloud(time_s: float, points: np.ndarray, names: str = "xyzi") -> dict[str, Any]:
    """float32 fields of 4 bytes each, one row."""
    columns = np.zeros((len(points), len(names)), np.float32)
    columns[:, : points.shape[1]] = points
    return {
        "header": header(time_s, "lidar"),
        "height": 1,
        "width": len(points),
        "is_bigendian": False,
        "is_dense": False,
        "fields": [
            {"name": name, "offset": 4 * k, "datatype": 7, "count": 1} for k, name in enumerate(names)
        ],
        "point_step": 4 * len(names),
        "row_step": 4 * len(names) * len(points),
        "data": columns.tobytes(),
    }


def _xyz(values: tuple[float, float, float]) -> dict[str, float]:
    return dict(zip("xyz", map(float, values), strict=True))


def _turned(yaw_rad: float) -> dict[str, float]:
    return {"x": 0.0, "y": 0.0, "z": float(np.sin(yaw_rad / 2)), "w": float(np.cos(yaw_rad / 2))}

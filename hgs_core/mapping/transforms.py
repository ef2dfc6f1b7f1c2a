"""`transforms.json`: cameras and images of a run's keyframes, in nerfstudio's layout.

`transform_matrix` is camera-to-world with OpenGL axes (x right, y up, z backward). Besides nerfstudio's keys
it holds what this project needs to learn from the images again: `low_pass_px2` (see `CameraIntrinsics`),
`depth_nothing_in_range` (the depth value that is no length) and, for each frame, `timestamp`.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.errors import MapError
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.keyframe_files import NOTHING_IN_RANGE

TRANSFORMS: Final = "transforms.json"
_OPENGL_FROM_OPENCV: Final = np.array([1.0, -1.0, -1.0, 1.0])
"""Signs of a camera's x, y and z axes and its origin."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Transforms:
    """One camera, and where it took which images. Paths are relative to the folder of the file."""

    intrinsics: CameraIntrinsics
    """Of the colour images; depth images may be smaller and show the same view."""
    depth_unit_m: float
    T_world_camera: SE3
    """Batched over frames."""
    timestamps_s: Float[ndarray, " n_frames"]
    colour_paths: tuple[str, ...]
    depth_paths: tuple[str, ...]


def write_transforms(transforms: Transforms, path: Path) -> None:
    """Write `path` whole or not at all (temporary file beside it, then rename)."""
    camera = transforms.intrinsics
    matrices = transforms.T_world_camera.as_matrix() * _OPENGL_FROM_OPENCV
    content = {
        "camera_model": "OPENCV",
        "w": camera.width,
        "h": camera.height,
        "fl_x": camera.fx,
        "fl_y": camera.fy,
        "cx": camera.cx,
        "cy": camera.cy,
        **dict.fromkeys(("k1", "k2", "p1", "p2"), 0.0),
        "low_pass_px2": camera.low_pass_px2,
        "depth_unit_scale_factor": transforms.depth_unit_m,
        "depth_nothing_in_range": NOTHING_IN_RANGE,
        "frames": [
            {
                "file_path": colour,
                "depth_file_path": depth,
                "timestamp": float(timestamp_s),
                "transform_matrix": matrix.tolist(),
            }
            for colour, depth, timestamp_s, matrix in zip(
                transforms.colour_paths,
                transforms.depth_paths,
                transforms.timestamps_s,
                matrices,
                strict=True,
            )
        ],
    }
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    partial.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    partial.replace(path)


def read_transforms(path: Path) -> Transforms:
    """Raises `MapError` for a file that is missing, damaged, without frames, or not of this project."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise MapError(
            f"cannot read {path}: {error.strerror}; it is where a run keeps its keyframes"
        ) from error
    except ValueError as error:
        raise MapError(f"{path} is not JSON: {error}") from error
    try:
        return _transforms(content)
    except (KeyError, TypeError, ValueError) as error:
        raise MapError(f"{path} is not the list of a run's keyframes: {error!r}") from error


def _transforms(content: Any) -> Transforms:
    frames = content["frames"]
    if not frames:
        raise ValueError("no frames")
    matrices = np.array([frame["transform_matrix"] for frame in frames], dtype=float)
    return Transforms(
        intrinsics=CameraIntrinsics(
            width=int(content["w"]),
            height=int(content["h"]),
            fx=float(content["fl_x"]),
            fy=float(content["fl_y"]),
            cx=float(content["cx"]),
            cy=float(content["cy"]),
            low_pass_px2=float(content["low_pass_px2"]),
        ),
        depth_unit_m=float(content["depth_unit_scale_factor"]),
        T_world_camera=SE3.from_matrix(matrices * _OPENGL_FROM_OPENCV),
        timestamps_s=np.array([frame["timestamp"] for frame in frames], dtype=float),
        colour_paths=tuple(str(frame["file_path"]) for frame in frames),
        depth_paths=tuple(str(frame["depth_file_path"]) for frame in frames),
    )

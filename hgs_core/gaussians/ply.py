"""`map.ply`: a Gaussian map in the attributes of the original 3D Gaussian splatting code.

```text
x y z         centre in the world [m]
nx ny nz      the normal of a disc, else 0 (common viewers expect the columns)
f_dc_0..2     (rgb - 0.5) / C0, with C0 = 1 / (2 sqrt(pi)) the constant spherical harmonic
opacity       logit of the opacity
scale_0..2    log of the radius [m], three times the same of isotropic Gaussians; of discs, which have no
              thickness, scale_2 is the log of a thousandth of it, as readers take the exponential
rot_0..3      the unit quaternion wxyz: 1 0 0 0, or what turns the z axis to the normal of a disc
```

All are float32, binary little endian, one `vertex` element. History (moments, information, keyframes) belongs
to checkpoints and is not in the file.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from hgs_core.errors import MapError
from hgs_core.gaussians.gaussian_map import (
    CENTRE,
    LOG_RADIUS,
    LOGIT_OPACITY,
    N_PARAMETERS,
    RGB,
    GaussianMap,
    Primitive,
)

SH_C0: Final = 0.28209479177387814

_LOG_THICKNESS: Final = float(np.log(1e-3))
_LEAST_LOG_THINNESS: Final = float(np.log(100.0))

PROPERTIES: Final = (
    *("x", "y", "z"),
    *("nx", "ny", "nz"),
    *(f"f_dc_{channel}" for channel in range(3)),
    "opacity",
    *(f"scale_{axis}" for axis in range(3)),
    *(f"rot_{component}" for component in range(4)),
)

_PLY_TYPES: Final = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "<i2",
    "int16": "<i2",
    "ushort": "<u2",
    "uint16": "<u2",
    "int": "<i4",
    "int32": "<i4",
    "uint": "<u4",
    "uint32": "<u4",
    "float": "<f4",
    "float32": "<f4",
    "double": "<f8",
    "float64": "<f8",
}


def write_ply(gaussians: GaussianMap, path: Path) -> None:
    """Write the rows in use to `path`, whole or not at all (temporary file beside it, then rename)."""
    parameters, normals = gaussians.parameters[: gaussians.size], gaussians.normals[: gaussians.size]
    table = np.zeros((len(parameters), len(PROPERTIES)), "<f4")
    table[:, 0:3] = parameters[:, CENTRE]
    table[:, 6:9] = (parameters[:, RGB] - 0.5) / SH_C0
    table[:, 9] = parameters[:, LOGIT_OPACITY]
    table[:, 10:13] = parameters[:, LOG_RADIUS, None]
    table[:, 13] = 1.0
    if gaussians.primitive == "disc":
        table[:, 3:6] = normals
        table[:, 12] += _LOG_THICKNESS
        table[:, 13:17] = _rotations_to(normals)
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(table)}",
        *(f"property float {name}" for name in PROPERTIES),
        "end_header",
    ]
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    with partial.open("wb") as file:
        file.write(("\n".join(header) + "\n").encode("ascii"))
        file.write(table.tobytes())
    partial.replace(path)


def read_ply(path: Path) -> GaussianMap:
    """The map in `path`: parameters and normals only, histories at zero, every anchor keyframe -1.

    Isotropic when all three scales are the same; discs when the third is at most a hundredth of the others.
    Accepts any order of properties and further ones (`f_rest_*` are view-dependent colour and are left out).
    Raises `MapError` for a file that is not a binary little-endian PLY, is cut short, lacks an attribute, or
    holds NaN or other Gaussians than these.
    """
    vertices = _read_vertices(path)
    missing = [name for name in PROPERTIES if name not in (vertices.dtype.names or ()) and name[0] != "n"]
    if missing:
        raise MapError(f"{path} lacks the Gaussian attributes {', '.join(missing)}: not a 3DGS file")
    scales = np.stack([vertices[f"scale_{axis}"] for axis in range(3)], axis=1)
    primitive = _primitive_of(scales)
    if primitive is None:
        raise MapError(
            f"{path} holds anisotropic Gaussians (scale_0..2 differ); only isotropic ones and discs, thin "
            "along their third axis, are supported"
        )
    parameters: Float32[ndarray, "n 8"] = np.empty((len(vertices), N_PARAMETERS), np.float32)
    parameters[:, CENTRE] = np.stack([vertices[name] for name in "xyz"], axis=1)
    parameters[:, RGB] = np.stack([vertices[f"f_dc_{c}"] for c in range(3)], axis=1) * SH_C0 + 0.5
    parameters[:, LOG_RADIUS] = scales[:, 0]
    parameters[:, LOGIT_OPACITY] = vertices["opacity"]
    if not np.isfinite(parameters).all():
        raise MapError(f"{path} holds NaN or infinite attributes: the file is damaged")
    gaussians = GaussianMap(primitive=primitive)
    if primitive == "isotropic":
        gaussians.append(parameters, anchor_keyframe=-1)
        return gaussians
    normals = _third_axes(np.stack([vertices[f"rot_{i}"] for i in range(4)], axis=1))
    if not np.isfinite(normals).all():
        raise MapError(f"{path} holds rotations that are none (rot_0..3): the file is damaged")
    gaussians.append(parameters, normals, anchor_keyframe=-1)
    return gaussians


def _primitive_of(log_scales: Float32[ndarray, "n 3"]) -> Primitive | None:
    if np.allclose(log_scales, log_scales[:, :1], atol=1e-4):
        return "isotropic"
    round_ = np.allclose(log_scales[:, 0], log_scales[:, 1], atol=1e-4)
    thin = bool(np.all(log_scales[:, 2] <= log_scales[:, 0] - _LEAST_LOG_THINNESS))
    return "disc" if round_ and thin else None


def _rotations_to(normals: Float32[ndarray, "n 3"]) -> Float32[ndarray, "n 4"]:
    """Quaternions wxyz of the shortest turns of the z axis to the normals, or to nearer opposites."""
    upwards = np.where(normals[:, 2:] < 0.0, -normals, normals)
    x, y, z = upwards.T
    quaternions = np.stack([1.0 + z, -y, x, np.zeros_like(z)], axis=1)
    unit: Float32[ndarray, "n 4"] = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    return unit


def _third_axes(quaternions: Float32[ndarray, "n 4"]) -> Float32[ndarray, "n 3"]:
    """What rotations make of the z axis; NaN for a quaternion of zeros."""
    with np.errstate(invalid="ignore"):
        w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    axes: Float32[ndarray, "n 3"] = np.stack(
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x**2 + y**2)], axis=1
    ).astype(np.float32)
    return axes


def _read_vertices(path: Path) -> ndarray:
    """The `vertex` element as a structured array; it must be the file's first element."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise MapError(f"cannot read {path}: {error.strerror}") from error
    head, separator, body = content.partition(b"end_header\n")
    lines = head.decode("ascii", errors="replace").split("\n")
    if lines[0].strip() != "ply" or not separator:
        raise MapError(f"{path} is not a PLY file")
    n_vertices: int | None = None
    fields: list[tuple[str, str]] = []
    element = ""
    for line in lines[1:]:
        match line.split():
            case ["format", kind, *_] if kind != "binary_little_endian":
                raise MapError(f"{path} is PLY {kind}; binary_little_endian is expected")
            case ["element", name, count]:
                if n_vertices is None and name != "vertex":
                    raise MapError(f"{path} begins with element {name!r}; 'vertex' is expected first")
                element = name
                n_vertices = int(count) if name == "vertex" else n_vertices
            case ["property", kind, name] if element == "vertex":
                if kind not in _PLY_TYPES:
                    raise MapError(f"{path}: property {name} has the unknown type {kind!r}")
                fields.append((name, _PLY_TYPES[kind]))
            case ["property", "list", *_] if element == "vertex":
                raise MapError(f"{path}: list properties on vertices are not part of a 3DGS file")
            case _:
                pass
    if n_vertices is None:
        raise MapError(f"{path} has no vertex element")
    dtype = np.dtype(fields)
    if len(body) < n_vertices * dtype.itemsize:
        raise MapError(
            f"{path} is cut short: {n_vertices} vertices need {n_vertices * dtype.itemsize} bytes, "
            f"{len(body)} are there"
        )
    return np.frombuffer(body, dtype, count=n_vertices)

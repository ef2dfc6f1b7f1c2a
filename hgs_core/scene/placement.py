"""Broken triangles, up axis and scale of a mesh from a file: found, repaired and stated."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.errors import SceneError
from hgs_core.scene.textured_mesh import TexturedMesh

# Rows give the world's x, y and z from the file's axes; all are rotations.
_WORLD_FROM_FILE: dict[str, list[list[float]]] = {
    "z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "x": [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
    "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    "-y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "-x": [[0, 1, 0], [0, 0, -1], [-1, 0, 0]],
}
_OUTLIER_FACTOR = 50.0
_WORLD_SIZE_M = (2.0, 200.0)
_ROOM_HEIGHT_M = (2.0, 6.0)
_DOUBTFUL = 1.5
"""So many times the area facing another axis than the one said to point up makes that one doubtful."""


def placed(mesh: TexturedMesh, *, scale: float | None, up_axis: str | None) -> tuple[TexturedMesh, list[str]]:
    """The mesh in metres with z up, without broken triangles, and a notice for every repair and doubt.

    Scale and axis are found where they are None. Raises `SceneError` when nothing is left
    or no scale makes a plausible building.
    """
    mesh, notices = _without_broken_triangles(mesh)
    axis = up_axis or _find_up_axis(mesh)
    if up_axis is None:
        notices.append(
            f"up axis taken to be {axis} (the shortest side of the scene; set scene.up_axis to change it)"
        )
    elif (other := _likelier_axis(mesh, up_axis)) is not None:
        notices.append(
            f"up axis is {axis}, but most of the surface faces {other}: if the scene lies on its side, set "
            f"scene.up_axis={other}"
        )
    mesh = mesh.moved(np.array(_WORLD_FROM_FILE[axis], dtype=float), np.zeros(3), scale or 1.0)
    if scale is None:
        factor = _find_scale(mesh)
        if factor != 1.0:
            notices.append(
                f"the file's unit is not the metre: rescaled by {factor:g} (set scene.scale to change it)"
            )
            mesh = mesh.moved(np.eye(3), np.zeros(3), factor)
    return mesh, notices


def _without_broken_triangles(mesh: TexturedMesh) -> tuple[TexturedMesh, list[str]]:
    notices = []
    finite = np.isfinite(mesh.corners_m).all(axis=(1, 2))
    if not finite.all():
        notices.append(f"dropped {int((~finite).sum())} triangles whose vertices are NaN or infinite")
        mesh = mesh.kept(finite)
    if len(mesh.triangles) == 0:
        raise SceneError("the mesh has no triangles with finite vertices: export it again")
    corners = mesh.corners_m.astype(np.float64)
    centre = np.median(corners.reshape(-1, 3), axis=0)
    reach = np.abs(corners - centre).max(axis=(1, 2))
    far = reach > _OUTLIER_FACTOR * np.percentile(reach, 90)
    if far.any():
        notices.append(
            f"dropped {int(far.sum())} triangles with vertices up to {reach.max():.3g} units away, more than "
            f"{_OUTLIER_FACTOR:g} times the size of the rest"
        )
        mesh = mesh.kept(~far)
    return mesh, notices


def _find_up_axis(mesh: TexturedMesh) -> str:
    """The axis along which the scene is shortest; between near equals, the one with most area facing it."""
    size = mesh.bounds().size_m
    candidates = np.flatnonzero(size <= 1.2 * size.min())
    return "xyz"[int(candidates[np.argmax(_facing(mesh)[candidates])])]


def _likelier_axis(mesh: TexturedMesh, up_axis: str) -> str | None:
    """An axis with much more level surface than `up_axis` has, or None."""
    facing = _facing(mesh)
    best = int(np.argmax(facing))
    return "xyz"[best] if facing[best] > _DOUBTFUL * facing["xyz".index(up_axis[-1])] else None


def _facing(mesh: TexturedMesh) -> Float[ndarray, " 3"]:
    """Surface [square units] that faces each axis, either way."""
    area: Float[ndarray, " 3"] = (np.abs(mesh.normals) > 0.95).T @ mesh.areas_m2
    return area


def _find_scale(mesh: TexturedMesh) -> float:
    size = mesh.bounds().size_m
    if _WORLD_SIZE_M[0] <= size.max() <= _WORLD_SIZE_M[1]:
        return 1.0
    for exponent in (-3, -2, -1, 1, 2, 3):
        factor = 10.0**exponent
        if (
            _WORLD_SIZE_M[0] <= factor * size.max() <= _WORLD_SIZE_M[1]
            and _ROOM_HEIGHT_M[0] <= factor * size[2] <= _ROOM_HEIGHT_M[1]
        ):
            return factor
    raise SceneError(
        f"the scene measures {' x '.join(f'{s:.4g}' for s in size)} units (z up), not a building of "
        f"{_WORLD_SIZE_M[0]:g} to {_WORLD_SIZE_M[1]:g} m, and no power of ten makes it "
        f"{_ROOM_HEIGHT_M[0]:g} to {_ROOM_HEIGHT_M[1]:g} m high: give scene.scale "
        "(metres per unit) and scene.up_axis"
    )

"""Broken triangles, scale, up axis and floor of a mesh from a file: found, repaired and stated."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.errors import SceneError
from hgs_core.scene.ray_caster import RayCaster
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
_STANDING_HEIGHT_M = 1.8
_MIN_COVERED_SHARE = 0.01
_LEVEL_BIN_M = 0.02


def placed(
    mesh: TexturedMesh, *, scale: float | None, up_axis: str | None, is_gltf: bool
) -> tuple[TexturedMesh, list[str]]:
    """The mesh in metres with z up, without broken triangles, and a notice for every repair.

    Raises `SceneError` when nothing is left or no scale makes a plausible building.
    """
    mesh, notices = _without_broken_triangles(mesh)
    axis = up_axis or ("y" if is_gltf else _find_up_axis(mesh))
    if up_axis is None and not is_gltf:
        notices.append(
            f"up axis taken to be {axis} (the shortest side of the scene; set up_axis to change it)"
        )
    mesh = mesh.moved(np.array(_WORLD_FROM_FILE[axis], dtype=float), np.zeros(3), scale or 1.0)
    if scale is None:
        factor = _find_scale(mesh)
        if factor != 1.0:
            notices.append(
                f"the file's unit is not the metre: rescaled by {factor:g} (set scale to change it)"
            )
            mesh = mesh.moved(np.eye(3), np.zeros(3), factor)
    return mesh, notices


def find_floor_z(caster: RayCaster) -> float:
    """Height [m] of the lowest large level surface with room to stand above it.

    Level triangles are gathered in bins of 2 cm; of those with at least a third of the largest bin's
    standing area the lowest is the floor. The underside of a floor slab has no room above it, so it never
    counts; a roof counts only in a scene without covered floor.
    """
    mesh = caster.mesh
    level = np.abs(mesh.normals[:, 2]) > 0.95
    if not level.any():
        raise SceneError(
            "the scene has no level surface that could be a floor: check up_axis, or give floor_z_m"
        )
    points, _ = mesh.kept(level).sample_surface(20000, np.random.default_rng(0))
    above = points + np.array([0.0, 0.0, 0.01])
    headroom = caster.cast(above, np.broadcast_to([0.0, 0.0, 1.0], above.shape))
    covered = (headroom > _STANDING_HEIGHT_M) & np.isfinite(headroom)
    # A roof is level with all the room in the world above: open sky counts only where nothing is covered.
    indoors = np.mean(covered) > _MIN_COVERED_SHARE
    standing = points[covered if indoors else headroom > _STANDING_HEIGHT_M, 2]
    if len(standing) == 0:
        raise SceneError(
            f"nowhere in the scene is there {_STANDING_HEIGHT_M} m of room above a level surface: "
            "check scale and up_axis, or give floor_z_m"
        )
    bins = np.floor((standing - standing.min()) / _LEVEL_BIN_M).astype(int)
    counts = np.bincount(bins)
    # Two neighbouring bins count together: a floor may lie on their border.
    joined = counts + np.append(counts[1:], 0)
    lowest = int(np.argmax(joined >= joined.max() / 3))
    return float(np.median(standing[(bins == lowest) | (bins == lowest + 1)]))


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
    facing: Float[ndarray, " 3"] = (np.abs(mesh.normals) > 0.95).T @ mesh.areas_m2
    return "xyz"[int(candidates[np.argmax(facing[candidates])])]


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
        f"{_ROOM_HEIGHT_M[0]:g} to {_ROOM_HEIGHT_M[1]:g} m high: give scale (metres per unit) and up_axis"
    )

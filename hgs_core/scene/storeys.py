"""Floors of a mesh that is z up: which there are, and the mesh cut down to one of them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.errors import SceneError
from hgs_core.scene.free_floor import free_area_m2
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.textured_mesh import TexturedMesh

_STANDING_HEIGHT_M = 1.8
_MIN_COVERED_SHARE = 0.01
_LEVEL_BIN_M = 0.02
_STOREY_HEIGHT_M = 2.0
"""Two floors are at least this far apart: nearer levels are furniture, landings or a split level."""
_BELOW_FLOOR_M = 0.25
"""A storey's own surface reaches this far below its floor; a slab's underside lies deeper."""
_SAMPLES = 20000


def find_floors_z(mesh_caster: RayCaster) -> tuple[float, ...]:
    """Heights [m] of the large level surfaces with room to stand above, at least a storey apart, upwards.

    Level triangles are gathered in bins of 2 cm; a bin with at least a third of the largest one's standing
    area is a floor unless one lies less than a storey below. The underside of a floor slab has no room above
    it, so it never counts; a roof counts only in a scene without covered floor.
    Raises `SceneError` when there is none.
    """
    standing = _standing_heights(mesh_caster)
    bins = np.floor((standing - standing.min()) / _LEVEL_BIN_M).astype(int)
    counts = np.bincount(bins)
    # Two neighbouring bins count together: a floor may lie on their border.
    joined = counts + np.append(counts[1:], 0)
    floors: list[float] = []
    for first in np.flatnonzero(joined >= joined.max() / 3):
        z_m = float(np.median(standing[(bins == first) | (bins == first + 1)]))
        if not floors or z_m >= floors[-1] + _STOREY_HEIGHT_M:
            floors.append(z_m)
    return tuple(floors)


def storey_at(mesh: TexturedMesh, floor_z_m: float, floors_z_m: tuple[float, ...]) -> RayCaster:
    """The mesh with its floor at `floor_z_m` moved to z = 0, without what lies wholly on the other floors."""
    above = [z for z in floors_z_m if z >= floor_z_m + _STOREY_HEIGHT_M]
    below = [z for z in floors_z_m if z <= floor_z_m - _STOREY_HEIGHT_M]
    if above or below:
        z = mesh.corners_m[:, :, 2]
        keep = np.ones(len(mesh.triangles), bool)
        if above:
            keep &= z.min(axis=1) < min(above) - _LEVEL_BIN_M
        if below:
            keep &= z.max(axis=1) > floor_z_m - _BELOW_FLOOR_M
        mesh = mesh.kept(keep)
    return RayCaster(_lowered(mesh, floor_z_m))


def free_areas_m2(
    mesh: TexturedMesh, floors_z_m: tuple[float, ...], *, radius_m: float, height_m: float
) -> tuple[float, ...]:
    """The largest area [m2] that the robot can drive on without a break, floor by floor."""
    storeys = (storey_at(mesh, z, floors_z_m) for z in floors_z_m)
    return tuple(free_area_m2(caster, radius_m, height_m) for caster in storeys)


def _lowered(mesh: TexturedMesh, floor_z_m: float) -> TexturedMesh:
    if abs(floor_z_m) <= 1e-6:
        return mesh
    return mesh.moved(np.eye(3), np.array([0.0, 0.0, -floor_z_m]))


def _standing_heights(caster: RayCaster) -> Float[ndarray, " n"]:
    """Heights of level surface, sampled by area, where somebody could stand."""
    level = np.abs(caster.mesh.normals[:, 2]) > 0.95
    if not level.any():
        raise SceneError(
            "the scene has no level surface that could be a floor: check scene.up_axis, or give "
            "scene.floor_z_m"
        )
    points, _ = caster.mesh.kept(level).sample_surface(_SAMPLES, np.random.default_rng(0))
    above = points + np.array([0.0, 0.0, 0.01])
    headroom = caster.cast(above, np.broadcast_to([0.0, 0.0, 1.0], above.shape))
    covered = (headroom > _STANDING_HEIGHT_M) & np.isfinite(headroom)
    # A roof is level with all the room in the world above: open sky counts only where nothing is covered.
    indoors = np.mean(covered) > _MIN_COVERED_SHARE
    standing: Float[ndarray, " n"] = points[covered if indoors else headroom > _STANDING_HEIGHT_M, 2]
    if len(standing) == 0:
        raise SceneError(
            f"nowhere in the scene is there {_STANDING_HEIGHT_M} m of room above a level surface: "
            "check scene.scale and scene.up_axis, or give scene.floor_z_m"
        )
    return standing

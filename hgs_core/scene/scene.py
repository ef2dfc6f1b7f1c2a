"""`open_scene`: a name, a mesh file or a scan's folder becomes a world that a robot can stand in."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hgs_core.errors import SceneError
from hgs_core.geometry.boxes import Box
from hgs_core.scene.free_floor import StartPose, choose_start, start_fault
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.scene.options import SceneOptions, StartOptions
from hgs_core.scene.placement import placed
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.registry import source_of
from hgs_core.scene.source import RawScene
from hgs_core.scene.storeys import find_floors_z, free_areas_m2, storey_at
from hgs_core.scene.textured_mesh import TexturedMesh


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """A world: z up, metres, floor at z = 0. `notices` states every repair and choice that was made."""

    name: str
    mesh: TexturedMesh
    caster: RayCaster
    bounds: Box
    start: StartPose
    notices: tuple[str, ...]


def open_scene(
    source: str | Path,
    options: SceneOptions | None = None,
    *,
    radius_m: float = 0.25,
    height_m: float = 1.1,
) -> Scene:
    """The world named by `source`: a name (`house`, `house:SEED`, `building`, ...), a mesh file or the folder
    of a scan; see `scene_sources()`.

    `radius_m` and `height_m` are the robot's; the start is checked or chosen for them. Raises `SceneError`
    saying what was found and what to do when the mesh cannot serve as a world.
    """
    given = options or SceneOptions()
    raw = source_of(str(source)).read(str(source))
    notices = list(raw.notices)
    if raw.in_world:
        if given.model_copy(update={"start": None}) != SceneOptions():
            raise SceneError(
                "scale, up_axis, floor_z_m and all_storeys are for meshes in a frame of their own: "
                f"{raw.name} is made as it stands"
            )
        caster = RayCaster(raw.mesh)
    else:
        caster = _placed_caster(raw, given.over(raw.known), radius_m, height_m, notices)
    start = _start(caster, given.over(raw.known).start, radius_m, height_m, notices)
    return Scene(
        name=raw.name,
        mesh=caster.mesh,
        caster=caster,
        bounds=caster.mesh.bounds(),
        start=start,
        notices=tuple(notices),
    )


def _placed_caster(
    raw: RawScene, options: SceneOptions, radius_m: float, height_m: float, notices: list[str]
) -> RayCaster:
    """Metres, z up, the chosen floor at z = 0."""
    mesh, placing = placed(raw.mesh, scale=options.scale, up_axis=options.up_axis)
    notices += placing
    floors = _floors_z(mesh, options)
    floor_z = options.floor_z_m
    if floor_z is None:
        floor_z = _chosen_floor_z(mesh, floors, radius_m, height_m, notices)
    caster = storey_at(mesh, floor_z, () if options.all_storeys else floors)
    if abs(floor_z) > 0.02:
        notices.append(f"floor found at z = {floor_z:.3f} m in the file: moved to z = 0")
    left_out = len(mesh.triangles) - len(caster.mesh.triangles)
    if left_out:
        notices.append(
            f"other storeys are left out: {left_out} of {len(mesh.triangles)} triangles "
            "(scene.all_storeys=true keeps them)"
        )
    return caster


def _chosen_floor_z(
    mesh: TexturedMesh, floors: tuple[float, ...], radius_m: float, height_m: float, notices: list[str]
) -> float:
    """The floor with the largest free area for the robot."""
    if len(floors) == 1:
        return floors[0]
    areas = free_areas_m2(mesh, floors, radius_m=radius_m, height_m=height_m)
    listing = ", ".join(f"{z:.2f} m ({area:.0f} m2 free)" for z, area in zip(floors, areas, strict=True))
    notices.append(
        f"{len(floors)} storeys, with floors at z = {listing}: the one with the most free area is chosen "
        "(scene.floor_z_m chooses another)"
    )
    return floors[int(np.argmax(areas))]


def _floors_z(mesh: TexturedMesh, options: SceneOptions) -> tuple[float, ...]:
    """All floors of the mesh that may part it into storeys."""
    if options.floor_z_m is None:
        return find_floors_z(RayCaster(mesh))
    try:
        return () if options.all_storeys else find_floors_z(RayCaster(mesh))
    except SceneError:  # a floor is given by hand just where none is found
        return ()


def _start(
    caster: RayCaster, given: StartOptions | None, radius_m: float, height_m: float, notices: list[str]
) -> StartPose:
    if given is None:
        return choose_start(caster, radius_m, height_m)
    fault = start_fault(caster, BodyObstacles(caster.mesh, height_m), given.x_m, given.y_m, radius_m)
    if fault is None:
        return StartPose(x_m=given.x_m, y_m=given.y_m, yaw_rad=float(np.deg2rad(given.yaw_deg)))
    chosen = choose_start(caster, radius_m, height_m)
    notices.append(
        f"the given start ({given.x_m:.2f}, {given.y_m:.2f}) cannot be used: {fault}; "
        f"chosen instead: ({chosen.x_m:.2f}, {chosen.y_m:.2f})"
    )
    return chosen

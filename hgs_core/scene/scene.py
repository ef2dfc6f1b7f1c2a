"""`open_scene`: a name or a mesh file becomes a world that a robot can stand in."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.errors import SceneError
from hgs_core.geometry.boxes import Box
from hgs_core.scene.built_in import BUILT_IN_SCENES, built_in_scene
from hgs_core.scene.free_floor import StartPose, choose_start, start_fault
from hgs_core.scene.mesh_file import read_mesh_file
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.scene.placement import find_floor_z, placed
from hgs_core.scene.procedural.house import build_building, build_house
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.textured_mesh import TexturedMesh

_BUILDERS: Final[dict[str, Callable[[int], TexturedMesh]]] = {
    "house": build_house,
    "building": build_building,
}


class StartOptions(StrictConfig):
    """A start pose given by hand."""

    x_m: float
    """World x of the robot's axis [m], after the scene is placed."""
    y_m: float
    """World y of the robot's axis [m], after the scene is placed."""
    yaw_deg: float = 0.0
    """Heading [degrees], counter-clockwise from world +x."""


class SceneOptions(StrictConfig):
    """How a mesh file is placed in the world; what is None is found."""

    scale: float | None = Field(None, gt=0)
    """Metres per unit of the file."""
    up_axis: Literal["x", "y", "z", "-x", "-y", "-z"] | None = None
    """The file's axis that points up. GLB and glTF are y up by their standard."""
    floor_z_m: float | None = None
    """Height of the floor [m] in the file, after scaling and turning."""
    start: StartOptions | None = None
    """Where the robot starts."""


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
    """The world named by `source`: a built-in scene (`house`, `house:SEED`, `building`, ...) or a mesh file
    (.glb, .gltf, .obj, .ply).

    `radius_m` and `height_m` are the robot's; the start is checked or chosen for them. Raises `SceneError`
    saying what was found and what to do when the mesh cannot serve as a world.
    """
    options = options or SceneOptions()
    built_in = built_in_scene(str(source))
    if built_in is not None:
        return _made(*built_in, options, radius_m, height_m)
    path = Path(source)
    raw, notices = read_mesh_file(path)
    mesh, placing = placed(
        raw, scale=options.scale, up_axis=options.up_axis, is_gltf=path.suffix.lower() in (".glb", ".gltf")
    )
    notices += placing
    caster = RayCaster(mesh)
    floor_z = options.floor_z_m if options.floor_z_m is not None else find_floor_z(caster)
    if abs(floor_z) > 1e-6:
        mesh = mesh.moved(np.eye(3), np.array([0.0, 0.0, -floor_z]))
        caster = RayCaster(mesh)
        if abs(floor_z) > 0.02:
            notices.append(f"floor found at z = {floor_z:.3f} m in the file: moved to z = 0")
    start = _start(caster, _given_start(path, options, notices), radius_m, height_m, notices)
    return Scene(
        name=path.stem, mesh=mesh, caster=caster, bounds=mesh.bounds(), start=start, notices=tuple(notices)
    )


def list_scenes() -> tuple[str, ...]:
    """Names of the built-in scenes that `open_scene` knows; `NAME:SEED` gives further layouts."""
    return tuple(BUILT_IN_SCENES)


def _made(name: str, seed: int, options: SceneOptions, radius_m: float, height_m: float) -> Scene:
    if options.scale is not None or options.up_axis is not None or options.floor_z_m is not None:
        raise SceneError(f"scale, up_axis and floor_z_m are for mesh files: the built-in {name} has its own")
    mesh = _BUILDERS[name](seed)
    caster = RayCaster(mesh)
    notices: list[str] = []
    start = _start(caster, _start_of(options), radius_m, height_m, notices)
    return Scene(
        name=f"{name}:{seed}" if seed else name,
        mesh=mesh,
        caster=caster,
        bounds=mesh.bounds(),
        start=start,
        notices=tuple(notices),
    )


def _start_of(options: SceneOptions) -> StartPose | None:
    if options.start is None:
        return None
    given = options.start
    return StartPose(x_m=given.x_m, y_m=given.y_m, yaw_rad=float(np.deg2rad(given.yaw_deg)))


def _given_start(path: Path, options: SceneOptions, notices: list[str]) -> StartPose | None:
    if options.start is not None:
        return _start_of(options)
    sidecar = path.with_suffix(".json")
    if not sidecar.is_file():
        return None
    try:
        start = json.loads(sidecar.read_text(encoding="utf-8"))["start"]
        x, y = (float(value) for value in start["xyz"][:2])
        return StartPose(x_m=x, y_m=y, yaw_rad=float(np.deg2rad(float(start["yaw_deg"]))))
    except (KeyError, TypeError, ValueError) as error:
        notices.append(f"{sidecar.name} gives no usable start ({error!r}): a start is chosen")
        return None


def _start(
    caster: RayCaster, given: StartPose | None, radius_m: float, height_m: float, notices: list[str]
) -> StartPose:
    if given is not None:
        fault = start_fault(caster, BodyObstacles(caster.mesh, height_m), given.x_m, given.y_m, radius_m)
        if fault is None:
            return given
        chosen = choose_start(caster, radius_m, height_m)
        notices.append(
            f"the given start ({given.x_m:.2f}, {given.y_m:.2f}) cannot be used: {fault}; "
            f"chosen instead: ({chosen.x_m:.2f}, {chosen.y_m:.2f})"
        )
        return chosen
    return choose_start(caster, radius_m, height_m)

"""How a scene is placed in the world, as far as somebody says so."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from hgs_core.config.base import StrictConfig

UpAxis = Literal["x", "y", "z", "-x", "-y", "-z"]


class StartOptions(StrictConfig):
    """A start pose given by hand."""

    x_m: float
    """World x of the robot's axis [m], after the scene is placed."""
    y_m: float
    """World y of the robot's axis [m], after the scene is placed."""
    yaw_deg: float = 0.0
    """Heading [degrees], counter-clockwise from world +x."""


class SceneOptions(StrictConfig):
    """How a mesh is placed in the world; what is None is what its source knows, and else is found."""

    scale: float | None = Field(None, gt=0)
    """Metres per unit of the file."""
    up_axis: UpAxis | None = None
    """The file's axis that points up. GLB and glTF are y up by their standard."""
    floor_z_m: float | None = None
    """Height of the floor [m] in the file, after scaling and turning: of several storeys, which."""
    start: StartOptions | None = None
    """Where the robot starts."""
    all_storeys: bool | None = None
    """Keep every storey of a scan; else only the one that the robot stands on."""

    def over(self, known: SceneOptions) -> SceneOptions:
        """These options, and where they say nothing those of `known`."""
        chosen = {name: getattr(self, name) for name in type(self).model_fields}
        return known.model_copy(update={name: value for name, value in chosen.items() if value is not None})

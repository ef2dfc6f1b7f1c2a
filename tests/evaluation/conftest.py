"""Hand-built rooms: axis-aligned boxes of two triangles a side."""

from collections.abc import Callable

import numpy as np
import pytest

from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.textured_mesh import Material, TexturedMesh

Boxes = list[tuple[tuple[float, float, float], tuple[float, float, float]]]

_FACES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])


def mesh_of_boxes(boxes: Boxes) -> TexturedMesh:
    vertices, triangles = [], []
    for lower, upper in boxes:
        corners = np.array([lower, upper])
        choice = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
        base = 8 * len(vertices)
        vertices.append(corners[choice, np.arange(3)])
        triangles.append(base + np.concatenate([_FACES[:, [0, 1, 2]], _FACES[:, [0, 2, 3]]]))
    count = 12 * len(boxes)
    return TexturedMesh(
        vertices_m=np.concatenate(vertices).astype(np.float32),
        triangles=np.concatenate(triangles).astype(np.int32),
        uv=np.zeros((count, 3, 2), np.float32),
        material_index=np.zeros(count, np.int32),
        materials=(Material(name="plaster", factor=(0.8, 0.7, 0.6)),),
    )


@pytest.fixture(scope="session")
def cast_boxes() -> Callable[[Boxes], RayCaster]:
    """A ray caster of boxes given by their corners; the first is usually the room itself."""
    return lambda boxes: RayCaster(mesh_of_boxes(boxes))


@pytest.fixture(scope="session")
def empty_room(cast_boxes: Callable[[Boxes], RayCaster]) -> RayCaster:
    """4 x 3 m, 2.5 m high."""
    return cast_boxes([((0, 0, 0), (4, 3, 2.5))])


@pytest.fixture(scope="session")
def divided_room(cast_boxes: Callable[[Boxes], RayCaster]) -> RayCaster:
    """6 x 3 m with a wall of 20 cm at x = 3 m from floor to ceiling, and no door."""
    return cast_boxes([((0, 0, 0), (6, 3, 2.5)), ((2.9, 0, 0), (3.1, 3, 2.5))])

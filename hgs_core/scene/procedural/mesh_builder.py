"""Solids with texture coordinates in metres, gathered into one `TexturedMesh`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.scene.procedural.noise import Image
from hgs_core.scene.textured_mesh import Material, TexturedMesh

Point = tuple[float, float, float]

# Per face of a box: the axes that texture u and v run along, and the side (0 lower, 1 upper) with its
# corners.
_FACES = {
    "x": (0, 0, 1, 2),
    "X": (0, 1, 1, 2),
    "y": (1, 0, 0, 2),
    "Y": (1, 1, 0, 2),
    "z": (2, 0, 0, 1),
    "Z": (2, 1, 0, 1),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """A texture and how it is laid on: one copy measures `size_m` (u, v), or fits the whole face if None.

    With `grain` u runs along a face's longer side.
    """

    name: str
    texture: Image
    size_m: tuple[float, float] | None
    grain: bool = False


class _Store:
    def __init__(self) -> None:
        self.corners: list[Float[ndarray, "n 3 3"]] = []
        self.uv: list[Float[ndarray, "n 3 2"]] = []
        self.material: list[tuple[int, int]] = []
        self.surfaces: dict[str, tuple[int, Surface]] = {}

    def number(self, surface: Surface) -> int:
        return self.surfaces.setdefault(surface.name, (len(self.surfaces), surface))[0]


class MeshBuilder:
    """Adds solids in a local frame; `at` gives a builder for a frame placed within this one."""

    def __init__(self) -> None:
        self._store = _Store()
        self._rotation = np.eye(3)
        self._translation = np.zeros(3)

    def at(self, x: float, y: float, z: float = 0.0, yaw_rad: float = 0.0) -> MeshBuilder:
        """A builder into the same mesh whose frame stands at `(x, y, z)`, turned by `yaw_rad`."""
        child = MeshBuilder()
        child._store = self._store
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        child._rotation = self._rotation @ np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        child._translation = self._translation + self._rotation @ np.array([x, y, z])
        return child

    def triangles(
        self, corners: Float[ndarray, "n 3 3"], uv: Float[ndarray, "n 3 2"], surface: Surface
    ) -> None:
        self._store.corners.append(corners @ self._rotation.T + self._translation)
        self._store.uv.append(uv)
        self._store.material.append((len(corners), self._store.number(surface)))

    def sheet(
        self, points: Float[ndarray, "rows columns 3"], uv: Float[ndarray, "rows columns 2"], surface: Surface
    ) -> None:
        """A grid of quads; `uv` in metres, or in [0, 1] for a surface that fits."""
        if surface.size_m is not None:
            uv = uv / np.asarray(surface.size_m)
        a, b, c, d = (
            (slice(None, -1), slice(None, -1)),
            (slice(None, -1), slice(1, None)),
            (slice(1, None), slice(1, None)),
            (slice(1, None), slice(None, -1)),
        )
        for first, second, third in ((a, b, c), (a, c, d)):
            self.triangles(
                np.stack([points[first], points[second], points[third]], axis=2).reshape(-1, 3, 3),
                np.stack([uv[first], uv[second], uv[third]], axis=2).reshape(-1, 3, 2),
                surface,
            )

    def quad(
        self, corners: Sequence[Point], surface: Surface, offset_m: tuple[float, float] = (0, 0)
    ) -> None:
        """Corners in order lower left, lower right, upper right, upper left as the texture is read."""
        p = np.array(corners, dtype=float)
        points = np.array([[p[0], p[1]], [p[3], p[2]]])
        width, height = float(np.linalg.norm(p[1] - p[0])), float(np.linalg.norm(p[3] - p[0]))
        if surface.size_m is None:
            width = height = 1.0
        elif surface.grain and height > width:
            uv = np.array([[[0, 0], [0, width]], [[height, 0], [height, width]]], dtype=float)
            self.sheet(points, uv + np.asarray(offset_m), surface)
            return
        uv = np.array([[[0, 0], [width, 0]], [[0, height], [width, height]]], dtype=float)
        self.sheet(points, uv + np.asarray(offset_m), surface)

    def box(
        self,
        lower: Point,
        upper: Point,
        surface: Surface,
        *,
        without: str = "",
        faces: dict[str, Surface] | None = None,
    ) -> None:
        """A cuboid; faces are x y z (lower side) and X Y Z (upper side), left out or covered one by one."""
        bounds = np.array([lower, upper], dtype=float)
        # Every box starts elsewhere in its texture, so that equal boxes do not look alike.
        middle = bounds.mean(axis=0) @ self._rotation.T + self._translation
        offset = (float(middle[0] * 3.7 + middle[2] * 1.9), float(middle[1] * 2.3 + middle[2] * 3.1))
        for name, (axis, side, u_axis, v_axis) in _FACES.items():
            if name in without:
                continue
            chosen = (faces or {}).get(name, surface)
            corner = np.empty((4, 3))
            corner[:, axis] = bounds[side, axis]
            # Seen from outside, u must run to the viewer's right or lettering is mirrored.
            right = (0, 1, 1, 0) if name in "XyZ" else (1, 0, 0, 1)
            corner[:, u_axis] = bounds[list(right), u_axis]
            corner[:, v_axis] = bounds[[0, 0, 1, 1], v_axis]
            self.quad([tuple(c) for c in corner], chosen, (0.0, 0.0) if chosen.size_m is None else offset)

    def rounded_box(self, lower: Point, upper: Point, radius: float, surface: Surface) -> None:
        """A cuboid with its edges rounded by `radius`: cushions, mattresses, upholstery."""
        lo, hi = np.array(lower, float), np.array(upper, float)
        radius = min(radius, float((hi - lo).min()) / 2 * 0.999)
        for axis, side, u_axis, v_axis in _FACES.values():
            spans = [
                np.concatenate([lo[k] + radius * steps, (hi[k] - radius * steps)[::-1]])
                for k, steps in ((u_axis, np.array([0.0, 0.42, 1.0])), (v_axis, np.array([0.0, 0.42, 1.0])))
            ]
            v, u = np.meshgrid(spans[1], spans[0], indexing="ij")
            points = np.empty((*u.shape, 3))
            points[..., axis] = (lo, hi)[side][axis]
            points[..., u_axis], points[..., v_axis] = u, v
            core = np.clip(points, lo + radius, hi - radius)
            away = points - core
            length = np.linalg.norm(away, axis=-1, keepdims=True)
            points = core + radius * away / np.maximum(length, 1e-9)
            self.sheet(points, self._fitted(np.stack([u, v], axis=-1), surface), surface)

    def lathe(self, profile: Sequence[tuple[float, float]], surface: Surface, *, segments: int = 20) -> None:
        """A solid of revolution about the local z axis; `profile` lists (radius, z) end to end."""
        radius, z = np.array(profile, float).T
        angle = np.linspace(0, 2 * np.pi, segments + 1)
        points = np.stack(
            [
                radius[:, None] * np.cos(angle),
                radius[:, None] * np.sin(angle),
                np.repeat(z[:, None], segments + 1, 1),
            ],
            axis=-1,
        )
        along = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(radius), np.diff(z)))])
        u, v = np.meshgrid(angle * max(radius.max(), 0.02), along)
        self.sheet(points, self._fitted(np.stack([u, v], axis=-1), surface), surface)

    def cylinder(
        self, radius: float, z_lower: float, z_upper: float, surface: Surface, *, segments: int = 16
    ) -> None:
        self.lathe(
            [(0.0, z_lower), (radius, z_lower), (radius, z_upper), (0.0, z_upper)], surface, segments=segments
        )

    def rod(self, begin: Point, end: Point, radius: float, surface: Surface, *, segments: int = 8) -> None:
        """A round bar between two points, without caps."""
        a, b = np.array(begin, float), np.array(end, float)
        axis = (b - a) / np.linalg.norm(b - a)
        side = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
        side /= np.linalg.norm(side)
        other = np.cross(axis, side)
        angle = np.linspace(0, 2 * np.pi, segments + 1)
        ring = radius * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * other)
        length = float(np.linalg.norm(b - a))
        u, v = np.meshgrid(angle * radius, [0.0, length])
        uv = np.stack([v, u] if surface.grain else [u, v], axis=-1)
        self.sheet(np.stack([a + ring, b + ring]), self._fitted(uv, surface), surface)

    def mesh(self) -> TexturedMesh:
        """Everything added so far (to this builder and all its frames)."""
        store = self._store
        corners = np.concatenate(store.corners)
        uv = np.concatenate(store.uv)
        material = np.concatenate([np.full(count, number) for count, number in store.material])
        has_area = (
            np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
            > 1e-10
        )
        corners, uv, material = corners[has_area], uv[has_area], material[has_area]
        vertices, triangles = np.unique(
            corners.reshape(-1, 3).astype(np.float32), axis=0, return_inverse=True
        )
        return TexturedMesh(
            vertices_m=vertices,
            triangles=triangles.reshape(-1, 3).astype(np.int32),
            uv=uv.astype(np.float32),
            material_index=material.astype(np.int32),
            materials=tuple(
                Material(name=surface.name, texture=surface.texture) for _, surface in store.surfaces.values()
            ),
        )

    @staticmethod
    def _fitted(uv: Float[ndarray, "rows columns 2"], surface: Surface) -> Float[ndarray, "rows columns 2"]:
        """Metres as they are, or stretched to [0, 1] for a surface that fits."""
        if surface.size_m is not None:
            return uv
        lower, upper = uv.min(axis=(0, 1)), uv.max(axis=(0, 1))
        return (uv - lower) / np.maximum(upper - lower, 1e-9)

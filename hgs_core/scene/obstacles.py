"""What an upright body bumps into: the mesh between two heights, seen from above."""

from __future__ import annotations

import numpy as np
import open3d as o3d
from jaxtyping import Float, Float32
from numpy import ndarray

from hgs_core.robot.robot import STEP_HEIGHT_M
from hgs_core.scene.textured_mesh import TexturedMesh


class BodyObstacles:
    """Distances in the floor plane to everything between `STEP_HEIGHT_M` and `height_m`.

    Triangles are clipped to the band of heights and projected to the floor; distances to the projections are
    exact up to single precision. A closed solid whose top is above the band has an interior with distance >
    0: it cannot be entered without crossing its sides.
    """

    def __init__(self, mesh: TexturedMesh, height_m: float) -> None:
        self.height_m = height_m
        corners = mesh.corners_m.astype(np.float64)
        corners = _above(corners, STEP_HEIGHT_M)
        corners = _above(corners * [1.0, 1.0, -1.0], -height_m)
        self._has_obstacles = len(corners) > 0
        self._embree = o3d.t.geometry.RaycastingScene()
        if self._has_obstacles:
            flat = _projected(corners).astype(np.float32)
            self._embree.add_triangles(
                o3d.core.Tensor.from_numpy(flat.reshape(-1, 3)),
                o3d.core.Tensor.from_numpy(np.arange(3 * len(flat), dtype=np.uint32).reshape(-1, 3)),
            )

    def clearance_m(self, points: Float[ndarray, "*points 2"]) -> Float32[ndarray, "*points"]:
        """Distance [m] from a vertical axis at each point to the nearest obstacle; 0 inside one."""
        if not self._has_obstacles:
            return np.full(points.shape[:-1], np.inf, dtype=np.float32)
        query = np.zeros((points[..., 0].size, 3), dtype=np.float32)
        query[:, :2] = points.reshape(-1, 2)
        distance = self._embree.compute_distance(o3d.core.Tensor.from_numpy(query)).numpy()
        return distance.reshape(points.shape[:-1])


def _above(corners: Float[ndarray, "n 3 3"], z_m: float) -> Float[ndarray, "m 3 3"]:
    """Triangles clipped to heights of at least `z_m`: one or two triangles where the plane cuts one."""
    inside = corners[:, :, 2] >= z_m
    count = inside.sum(axis=1)
    parts = [corners[count == 3]]
    for lone_inside in (True, False):
        cut = count == (1 if lone_inside else 2)
        # Turn each triangle so that the corner alone on its side of the plane comes first.
        lone = np.argmax(inside[cut] == lone_inside, axis=1)
        turned = corners[cut][np.arange(cut.sum())[:, None], (lone[:, None] + np.arange(3)) % 3]
        a, b, c = turned[:, 0], turned[:, 1], turned[:, 2]
        ab = a + (b - a) * ((z_m - a[:, 2]) / (b[:, 2] - a[:, 2]))[:, None]
        ac = a + (c - a) * ((z_m - a[:, 2]) / (c[:, 2] - a[:, 2]))[:, None]
        if lone_inside:
            parts.append(np.stack([a, ab, ac], axis=1))
        else:
            parts.extend([np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)])
    return np.concatenate(parts)


def _projected(corners: Float[ndarray, "n 3 3"]) -> Float[ndarray, "m 3 3"]:
    """Triangles in the plane z = 0, or upright ones standing on it for those that project to a line.

    Distance queries fail on triangles without area. One that projects to a segment A-B is replaced by (A, B,
    B + 1 m up), which from z = 0 is just as far away as the segment.
    """
    flat = corners.copy()
    flat[:, :, 2] = 0.0
    ab, ac = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    double_area = np.abs(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    sides = np.stack([ab, flat[:, 2] - flat[:, 1], -ac], axis=1)
    lengths = np.linalg.norm(sides, axis=2)
    longest = np.argmax(lengths, axis=1)
    rows = np.arange(len(flat))
    thin = double_area <= 1e-5 * np.maximum(lengths[rows, longest], 1e-6)
    first = flat[rows, longest][thin]
    second = flat[rows, (longest + 1) % 3][thin]
    # A triangle that projects to a point (or nearly) still needs a segment of some length.
    second[:, 0] += np.where(lengths[rows, longest][thin] < 1e-6, 1e-5, 0.0)
    upright = np.stack([first, second, second + np.array([0.0, 0.0, 1.0])], axis=1)
    return np.concatenate([flat[~thin], upright])

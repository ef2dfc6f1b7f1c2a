"""Simple polygons on the floor plane: what lies inside, and how far away everything else is.

A polygon is its corners in order, either way round; the last is joined to the first.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

Corners = Float[ndarray, "n_corners 2"]


def contains(corners_m: Corners, points_m: Float[ndarray, "n 2"]) -> Bool[ndarray, " n"]:
    """Which points lie inside (half-open: of two polygons with a common edge, one has a point on it)."""
    inside = np.zeros(len(points_m), bool)
    x, y = points_m[:, 0], points_m[:, 1]
    for (ax, ay), (bx, by) in _edges(corners_m):
        crosses = (ay > y) != (by > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = ax + (y - ay) * (bx - ax) / (by - ay)
        inside ^= crosses & (x < at)
    return inside


def distance_m(corners_m: Corners, points_m: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
    """From each point to the polygon; 0 inside."""
    nearest_m2 = np.full(len(points_m), np.inf)
    for a, b in _edges(corners_m):
        along = b - a
        length_m2 = max(float(along @ along), 1e-18)
        share = np.clip((points_m - a) @ along / length_m2, 0.0, 1.0)
        off = points_m - (a + share[:, None] * along)
        nearest_m2 = np.minimum(nearest_m2, off[:, 0] ** 2 + off[:, 1] ** 2)
    return np.where(contains(corners_m, points_m), 0.0, np.sqrt(nearest_m2))


def area_m2(corners_m: Corners) -> float:
    """What the outline encloses."""
    x, y = corners_m[:, 0], corners_m[:, 1]
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2.0


def crossing_edges(corners_m: Corners) -> tuple[int, int] | None:
    """Two edges that cross each other (edge `i` begins at corner `i`), or None. Touching is no crossing."""
    ends_m = np.roll(corners_m, -1, axis=0)
    from_start, from_end = _sides(corners_m, ends_m, corners_m), _sides(corners_m, ends_m, ends_m)
    splits = from_start * from_end < 0  # [i, j]: the line of edge i has the ends of edge j on both sides
    found = np.argwhere(np.triu(splits & splits.T))
    return (int(found[0, 0]), int(found[0, 1])) if len(found) else None


def _sides(starts_m: Corners, ends_m: Corners, points_m: Corners) -> Float[ndarray, "n_edges n_points"]:
    """On which side of each edge's line each point lies: 1 left, -1 right, 0 on it."""
    along, off = ends_m - starts_m, points_m[None] - starts_m[:, None]
    return np.sign(along[:, None, 0] * off[..., 1] - along[:, None, 1] * off[..., 0])


def _edges(corners_m: Corners) -> list[tuple[Float[ndarray, " 2"], Float[ndarray, " 2"]]]:
    return list(zip(corners_m, np.roll(corners_m, -1, axis=0), strict=True))

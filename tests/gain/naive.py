"""The gains' definitions written down plainly: the oracle of the fast march. Tiny maps only."""

from itertools import pairwise

import numpy as np
from numpy import ndarray

from hgs_core.gain.field import GainField
from hgs_core.gain.panorama import OPAQUE_BELOW, PanoramaGrid
from hgs_core.gaussians.gaussian_map import GaussianMap


def pieces(
    start: ndarray, end: ndarray, shape: tuple[int, ...]
) -> list[tuple[tuple[int, ...], float, float]]:
    """The voxels inside `shape` that a segment crosses, with the segment's parameters at entry and exit."""
    d = end - start
    ts = {0.0, 1.0}
    for axis in range(3):
        if d[axis] != 0:
            low, high = sorted((start[axis], end[axis]))
            ts |= {(x - start[axis]) / d[axis] for x in range(int(np.ceil(low)), int(np.floor(high)) + 1)}
    crossed = []
    for a, b in pairwise(sorted(t for t in ts if 0 <= t <= 1)):
        cell = tuple(int(x) for x in np.floor(start + (a + b) / 2 * d))
        if all(0 <= c < n for c, n in zip(cell, shape, strict=True)):
            crossed.append((cell, a, b))
    return crossed


def directions(grid: PanoramaGrid, row: int, column: int) -> tuple[float, float]:
    """Azimuth and tangent of the elevation of a bin's ray."""
    golden = (np.sqrt(5) - 1) / 2
    azimuth = -np.pi + (column + golden * (row + 1) % 1) * grid.azimuth_step_rad
    return azimuth, grid.tan_low + (row + 0.5) * (grid.tan_high - grid.tan_low) / grid.n_elevations


def march_one(
    grid: PanoramaGrid, field: GainField, position_m: ndarray, *, range_m: float, free_path_m: float
) -> tuple[ndarray, ndarray, ndarray, ndarray]:
    """Unseen volume [m^3], unseen voxels, new surface [m^2] and first unseen voxel of one viewpoint:
    (n_elevations, n_azimuths) each."""
    size_m = field.size_m
    results = np.zeros((3, grid.n_elevations, grid.n_azimuths))
    first_unseen = np.full(results.shape[1:], -1)
    solid = grid.azimuth_step_rad * (grid.tan_high - grid.tan_low) / grid.n_elevations
    start = position_m / size_m - field.first_index
    for row in range(grid.n_elevations):
        for column in range(grid.n_azimuths):
            phi, u = directions(grid, row, column)
            end = start + range_m / size_m * np.array([np.cos(phi), np.sin(phi), u])
            left = 1.0
            for cell, a, b in pieces(start, end, field.cells.shape[:3]):
                depth, unseen = (float(x) for x in field.cells[cell])
                rho = np.array([a, b]) * range_m
                if left < OPAQUE_BELOW:
                    break
                length = (b - a) * np.linalg.norm(end - start)
                if unseen:
                    volume = solid * (rho[1] ** 3 - rho[0] ** 3) / 3
                    results[0, row, column] += left * volume
                    results[1, row, column] += left
                    results[2, row, column] += left * volume * unseen / free_path_m
                    left *= np.exp(-length * size_m * unseen / free_path_m)
                    if first_unseen[row, column] < 0:
                        first_unseen[row, column] = np.ravel_multi_index(cell, field.cells.shape[:3])
                left *= np.exp(-depth * length)
    return results[0], results[1], results[2], first_unseen


def gathered(
    gaussians: GaussianMap, lower_m: ndarray, shape: tuple[int, ...], size_m: float
) -> tuple[ndarray, ndarray]:
    """Optical depth and number of Gaussians per voxel."""
    depth, count = np.zeros(shape), np.zeros(shape, int)
    cells = np.floor((gaussians.centres_m.astype(float) - lower_m) / size_m).astype(int)
    inside = np.all((cells >= 0) & (cells < shape), axis=1) & (gaussians.opacities >= 0.005)
    for i in np.flatnonzero(inside):
        cell = tuple(cells[i])
        depth[cell] += gaussians.opacities[i] * 2 * np.pi * gaussians.radii_m[i] ** 2 / size_m**2
        count[cell] += 1
    return depth, count

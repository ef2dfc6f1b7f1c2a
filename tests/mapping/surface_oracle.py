"""Normals of the surfaces in a depth image, by plain array arithmetic: what the kernel is tested against."""

import numpy as np

from hgs_core.geometry.camera import CameraIntrinsics

HALF_WINDOW = 3
FEWEST_ON_PLANE = 12
OFF_PLANE_M = 0.03
FITS = 2


def plain_normals(
    depth_m: np.ndarray, camera: CameraIntrinsics, rows: np.ndarray, columns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The normals, and of each how many pixels of its window lie on its plane."""
    offsets = np.arange(-HALF_WINDOW, HALF_WINDOW + 1)
    down, across = (grid.ravel() for grid in np.meshgrid(offsets, offsets, indexing="ij"))
    basis = np.stack([np.ones(down.size), across, down], axis=1)
    products = (basis[:, :, None] * basis[:, None, :]).reshape(down.size, 9)
    z = depth_m[rows, columns].astype(np.float64)
    around = inverse_depth(depth_m, rows[:, None] + down, columns[:, None] + across)
    known = np.isfinite(around)
    around = np.where(known, around, 0.0)
    plane = np.stack(
        [1.0 / z, slopes(depth_m, rows, columns, 0, 1), slopes(depth_m, rows, columns, 1, 0)], axis=1
    )
    for _ in range(FITS):
        on_plane = known & (np.abs(around - plane @ basis.T) * z[:, None] ** 2 < OFF_PLANE_M)
        normal_matrix = (on_plane @ products).reshape(-1, 3, 3) + 1e-9 * np.eye(3)
        plane = np.linalg.solve(normal_matrix, ((on_plane * around) @ basis)[..., None])[..., 0]
    x, y = (columns + 0.5 - camera.cx) / camera.fx, (rows + 0.5 - camera.cy) / camera.fy
    ray = np.stack([x, y, np.ones_like(x)], axis=1)
    along_u, along_v = plane[:, 1] * camera.fx, plane[:, 2] * camera.fy
    normals = np.stack([along_u, along_v, plane[:, 0] - along_u * x - along_v * y], axis=1)
    count = on_plane.sum(axis=1)
    found = (count >= FEWEST_ON_PLANE) & (np.sum(normals * ray, axis=1) > 0.0)
    towards = np.where(found[:, None], -normals, -ray)
    return towards / np.linalg.norm(towards, axis=1, keepdims=True), count


def slopes(depth_m: np.ndarray, rows: np.ndarray, columns: np.ndarray, down: int, across: int) -> np.ndarray:
    here = 1.0 / depth_m[rows, columns].astype(np.float64)
    forward = inverse_depth(depth_m, rows + down, columns + across) - here
    backward = here - inverse_depth(depth_m, rows - down, columns - across)
    take_forward = np.isnan(backward) | (np.abs(forward) <= np.abs(backward))
    return np.nan_to_num(np.where(take_forward, forward, backward))


def inverse_depth(depth_m: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    height, width = depth_m.shape
    depth = depth_m[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)].astype(np.float64)
    known = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    known &= (depth > 0) & np.isfinite(depth)
    return np.where(known, 1.0 / np.where(known, depth, 1.0), np.nan)

"""The voxel map's rules written down plainly: the oracle of the fast kernels."""

from itertools import pairwise

import numpy as np
from numpy import ndarray
from scipy import ndimage

from hgs_core.sensing.frame import Frame
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelState

NEIGHBOURS = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]


def inside(cell: tuple[int, ...], array: ndarray) -> bool:
    return all(0 <= c < n for c, n in zip(cell, array.shape, strict=True))


def cells_on_segment(start: ndarray, end: ndarray) -> list[tuple[int, int, int]]:
    """Unit cells that a segment crosses, in order: one between each two neighbouring plane crossings."""
    d = end - start
    ts = {0.0, 1.0}
    for axis in range(3):
        if d[axis] != 0:
            low, high = sorted((start[axis], end[axis]))
            ts |= {
                (plane - start[axis]) / d[axis] for plane in range(int(np.ceil(low)), int(np.floor(high)) + 1)
            }
    order = sorted(t for t in ts if 0 <= t <= 1)
    middles = [start + (a + b) / 2 * d for a, b in pairwise(order)]
    return [tuple(int(x) for x in np.floor(p)) for p in middles]


def update_by_rays(
    config: VoxelConfig,
    states: ndarray,
    log_odds: ndarray,
    origin_index: ndarray,
    origin_m: ndarray,
    ends_m: ndarray,
    is_hit: ndarray,
) -> None:
    """One frame of rays into the arrays, in place."""
    hits, passes = set(), set()
    for end_m, hit in zip(ends_m, is_hit, strict=True):
        start, end = origin_m / config.size_m - origin_index, end_m / config.size_m - origin_index
        last = tuple(int(x) for x in np.floor(end))
        passes |= {c for c in cells_on_segment(start, end) if not (hit and c == last)}
        if hit:
            hits.add(last)
    for cells, change in ((hits, config.log_odds_hit), (passes - hits, config.log_odds_miss)):
        for cell in cells:
            if all(0 <= c < n for c, n in zip(cell, states.shape, strict=True)):
                log_odds[cell] = np.clip(
                    np.float32(log_odds[cell] + np.float32(change)), *config.log_odds_limits
                )
                states[cell] = VoxelState.OCCUPIED if log_odds[cell] > 0 else VoxelState.FREE


def sampled_rays(frame: Frame, stride: int, range_m: float) -> tuple[ndarray, ndarray]:
    """Ends [m] and hit flags of the strided pixels' rays."""
    rays = frame.intrinsics.rays()
    ends, hits = [], []
    for row in range(stride // 2, frame.intrinsics.height, stride):
        for column in range(stride // 2, frame.intrinsics.width, stride):
            depth = float(frame.depth_m[row, column])
            if depth > 0:
                ends.append(frame.T_world_camera.apply(rays[row, column] * min(depth, range_m)))
                hits.append(depth <= range_m)
    return np.array(ends).reshape(-1, 3), np.array(hits, bool)


def has_free_neighbour(states: ndarray, cell: tuple[int, int, int]) -> bool:
    for step in NEIGHBOURS:
        n = tuple(a + b for a, b in zip(cell, step, strict=True))
        if (
            all(0 <= c < size for c, size in zip(n, states.shape, strict=True))
            and states[n] == VoxelState.FREE
        ):
            return True
    return False


def looked_at_in_vain(
    config: VoxelConfig, states: ndarray, origin_index: ndarray, frame: Frame, range_m: float
) -> list[tuple[int, int, int]]:
    """The voxels to which this frame adds an attempt."""
    found = []
    camera, pose = frame.intrinsics, frame.T_world_camera
    for cell in map(tuple, np.argwhere(states == VoxelState.UNOBSERVED).tolist()):
        centre = (np.array(cell) + origin_index + 0.5) * config.size_m
        p = pose.inverse().apply(centre)
        if not has_free_neighbour(states, cell) or not config.size_m / 2 < p[2] <= range_m:
            continue
        u, v = camera.fx * p[0] / p[2] + camera.cx, camera.fy * p[1] / p[2] + camera.cy
        border = config.pixel_stride
        if not (border <= u < camera.width - border and border <= v < camera.height - border):
            continue
        depth = float(frame.depth_m[int(v), int(u)])
        if depth == 0 or depth >= p[2]:
            continue
        end = pose.translation + (centre - pose.translation) * depth / p[2]
        if tuple((np.floor(end / config.size_m) - origin_index).astype(int)) == cell:
            continue
        on_the_way = cells_on_segment(
            pose.translation / config.size_m - origin_index, centre / config.size_m - origin_index
        )
        if all(c == cell or states[c] == VoxelState.FREE for c in on_the_way if inside(c, states)):
            found.append(cell)
    return found


def missing(config: VoxelConfig, states: ndarray, attempts: ndarray) -> ndarray:
    wanted = np.zeros(states.shape, bool)
    for cell in map(tuple, np.argwhere(states == VoxelState.UNOBSERVED).tolist()):
        wanted[cell] = has_free_neighbour(states, cell) and attempts[cell] < config.max_attempts
    labels, _ = ndimage.label(wanted, np.ones((3, 3, 3)))
    sizes = np.bincount(labels.ravel())
    return wanted & (sizes[labels] >= config.min_missing_cluster)

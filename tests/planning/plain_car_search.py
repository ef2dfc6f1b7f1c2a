"""The oracle for a car's ways: Dijkstra over (cell, heading), without estimates, words or buckets."""

import heapq

import numpy as np

from hgs_core.planning.car_ways import KinodynamicConfig, body_of, poses_free
from hgs_core.planning.navigation_grid import NavigationGrid
from hgs_core.robot.ackermann import AckermannConfig


def state_of(grid: NavigationGrid, pose: np.ndarray, n_headings: int) -> tuple[int, int, int]:
    i, j = np.floor(pose[:2] / grid.size_m).astype(int)
    return int(i), int(j), int(np.rint(pose[2] * n_headings / (2 * np.pi))) % n_headings


def plain_costs(
    grid: NavigationGrid,
    car: AckermannConfig,
    config: KinodynamicConfig,
    start: np.ndarray,
    *,
    step_m: float,
    turns: tuple[float, ...],
    n_headings: int,
    checks: int,
) -> np.ndarray:
    """Least costs [m] to every (cell, heading) of a grid that begins at the origin.

    Steps of one length lead along arcs of some shares of the tightest turn; along each the body is held
    against the grid at so many poses. Every state keeps the pose that came to it most cheaply.
    """
    body, radius_m = body_of(car, config.margin_m), car.planned_radius_m
    parts = np.arange(1, checks + 1) / checks
    motions = [(gear, turn) for gear in (1, -1) for turn in turns]
    best = np.full((*grid.shape, n_headings), np.inf)
    best[state_of(grid, start, n_headings)] = 0.0
    waiting: list[tuple[float, int, tuple]] = [(0.0, 0, (*start, 0, 0.0))]
    count = 0
    while waiting:
        cost, _, (x, y, yaw, gear, turn) = heapq.heappop(waiting)
        if best[state_of(grid, np.array([x, y, yaw]), n_headings)] < cost:
            continue
        arcs = np.array(
            [
                [_arc(x, y, yaw, new_turn / radius_m, new_gear * part * step_m) for part in parts]
                for new_gear, new_turn in motions
            ]
        )
        free = poses_free(grid, body, arcs.reshape(-1, 3), standing=start[None]).reshape(len(motions), -1)
        for poses, ok, (new_gear, new_turn) in zip(arcs, free.all(axis=1), motions, strict=True):
            if not ok:
                continue
            at = state_of(grid, poses[-1], n_headings)
            change = config.gear_change_m * (gear * new_gear < 0)
            steer = 0.5 * config.steering_change_m * abs(new_turn - turn) * (gear != 0)
            new = cost + step_m * (config.reverse_factor if new_gear < 0 else 1.0) + change + steer
            if new < best[at] - 1e-12:
                best[at] = new
                count += 1
                heapq.heappush(waiting, (new, count, (*poses[-1], new_gear, new_turn)))
    return best


def _arc(x: float, y: float, yaw: float, curvature: float, length: float) -> tuple[float, float, float]:
    if curvature == 0.0:
        return x + length * np.cos(yaw), y + length * np.sin(yaw), yaw
    after = yaw + curvature * length
    return (
        x + (np.sin(after) - np.sin(yaw)) / curvature,
        y - (np.cos(after) - np.cos(yaw)) / curvature,
        after,
    )

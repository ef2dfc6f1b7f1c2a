"""A stand-in for your robot: a point on wheels in an empty room of 6 x 4 x 2.5 m."""

import numpy as np

DRIVE = {"drive": "differential", "radius_m": 0.25, "height_m": 1.1, "max_speed_mps": 0.5}
REGION_M = [[-3.2, -2.2, -0.2], [3.2, 2.2, 2.7]]
WIDTH, HEIGHT, FOCAL_PX, CAMERA_M = 160, 90, 80.0, 1.0
CAMERA = {
    "width": WIDTH,
    "height": HEIGHT,
    "fx": FOCAL_PX,
    "fy": FOCAL_PX,
    "cx": WIDTH / 2,
    "cy": HEIGHT / 2,
    "range_m": 5.0,
    "mount_height_m": CAMERA_M,
    "frame_interval_s": 0.4,
}


class Robot:
    def __init__(self) -> None:
        self.x_m = self.y_m = self.yaw_rad = self.driven_m = 0.0
        self.limit_mps: float | None = None
        self._path = []
        self.waypoints_passed = 0

    @property
    def arrived(self) -> bool:
        return self.waypoints_passed >= len(self._path)

    def report(self) -> dict:
        where = {"x_m": self.x_m, "y_m": self.y_m, "yaw_rad": self.yaw_rad, "path_length_m": self.driven_m}
        return {
            **where,
            "waypoints_passed": self.waypoints_passed,
            "arrived": self.arrived,
            "standing": self.arrived,
        }

    def follow(self, positions_m, yaws_rad) -> None:
        self._path, self.waypoints_passed = list(zip(positions_m, yaws_rad, strict=True)), 0

    def stop(self) -> None:
        """It has no inertia. Yours brakes along its path, and is not `standing` until it stands."""
        self._path = self._path[: self.waypoints_passed]

    def step(self, duration_s: float) -> None:
        """Turn towards the next place, drive there, take up its yaw: at 1 rad/s and 0.5 m/s."""
        if self.arrived:
            return
        (x_m, y_m), yaw_rad = self._path[self.waypoints_passed]
        away_m = np.hypot(x_m - self.x_m, y_m - self.y_m)
        heading = np.arctan2(y_m - self.y_m, x_m - self.x_m) if away_m > 0.01 else yaw_rad
        turn = 0.0 if heading is None else (heading - self.yaw_rad + np.pi) % (2 * np.pi) - np.pi
        if abs(turn) > 0.01:
            self.yaw_rad += float(np.clip(turn, -duration_s, duration_s))
        elif away_m > 0.01:
            speed_mps = min(DRIVE["max_speed_mps"], self.limit_mps or np.inf)
            step_m = min(away_m, speed_mps * duration_s)
            self.x_m += float(step_m * np.cos(self.yaw_rad))
            self.y_m += float(step_m * np.sin(self.yaw_rad))
            self.driven_m += float(step_m)
        else:
            self.waypoints_passed += 1

    def capture(self):
        """`T_world_camera` (4, 4), colours (height, width, 3), and z-depths in metres (height, width)."""
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        pose = np.array(
            [[sin, 0, cos, self.x_m], [-cos, 0, sin, self.y_m], [0, -1, 0, CAMERA_M], [0, 0, 0, 1]]
        )
        row, column = np.mgrid[0.5:HEIGHT, 0.5:WIDTH]
        rays = np.stack([column - WIDTH / 2, row - HEIGHT / 2, np.full(row.shape, FOCAL_PX)], -1) / FOCAL_PX
        rays = rays @ pose[:3, :3].T
        rays[rays == 0] = 1e-9
        walls = np.where(rays > 0, [3.0, 2.0, 2.5], [-3.0, -2.0, 0.0])
        depth_m = ((walls - pose[:3, 3]) / rays).min(-1)
        hit = pose[:3, 3] + depth_m[..., None] * rays
        return pose, (127 + 100 * np.sin(4 * hit)).astype(np.uint8), depth_m

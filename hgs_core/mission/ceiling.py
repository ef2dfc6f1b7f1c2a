"""What of a scene the robot and the camera of a mission could see at all."""

from __future__ import annotations

from hgs_core.evaluation.ceiling import CeilingRequest
from hgs_core.mission.config import MissionConfig


def ceiling_request(config: MissionConfig, start_xy: tuple[float, float]) -> CeilingRequest:
    """For `observable_ceiling` and `full_knowledge_path`; `start_xy` is where the robot starts [m]."""
    camera = config.sensor.camera
    return CeilingRequest(
        start_xy=start_xy,
        robot_radius_m=config.robot.radius_m,
        robot_height_m=config.robot.height_m,
        camera_height_m=camera.mount_height_m,
        intrinsics=camera.intrinsics(),
        range_m=camera.range_m,
    )

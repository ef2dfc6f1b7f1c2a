"""Methods of localisation by name.

| `method` | needs | |
|---|---|---|
| `given` | poses in the stream | refuses impossible ones |
| `rgbd-odometry` | frames, 5 Hz or more | drifts |
| `lidar-odometry` | scans of a lidar on the robot, 10 Hz | drifts less |
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from hgs_core.errors import ConfigError
from hgs_core.geometry.se3 import SE3
from hgs_core.localisation.given import GivenConfig, GivenPoses
from hgs_core.localisation.lidar_odometry import LidarOdometry, LidarOdometryConfig
from hgs_core.localisation.localiser import LocalisationConfig, Localiser
from hgs_core.localisation.rgbd_odometry import RgbdOdometry, RgbdOdometryConfig

_CONFIGS: Final[dict[str, type[LocalisationConfig]]] = {
    "given": GivenConfig,
    "rgbd-odometry": RgbdOdometryConfig,
    "lidar-odometry": LidarOdometryConfig,
}


def localisation_methods() -> list[str]:
    """Names of all methods."""
    return list(_CONFIGS)


def localisation_config(content: Mapping[str, Any]) -> LocalisationConfig:
    """The settings of the method that `content["method"]` names (default: `given`).

    Raises `ConfigError` for an unknown method and pydantic's `ValidationError` for wrong settings.
    """
    method = content.get("method", "given")
    if not isinstance(method, str) or method not in _CONFIGS:
        raise ConfigError(f"localisation.method = {method!r}: must be one of {', '.join(_CONFIGS)}")
    return _CONFIGS[method].model_validate(dict(content))


def build_localiser(config: LocalisationConfig, *, start: SE3) -> Localiser:
    """The method that `config` is of. Odometries begin at `start`, the camera's pose (`T_world_camera`) at
    the first frame; given poses are what they are.

    Raises `ConfigError` for settings of no method, and where a library that it needs is missing.
    """
    if isinstance(config, GivenConfig):
        return GivenPoses(config)
    if isinstance(config, RgbdOdometryConfig):
        return RgbdOdometry(config, start)
    if isinstance(config, LidarOdometryConfig):
        return LidarOdometry(config, start)
    raise ConfigError(f"{type(config).__name__} is of no method: expected one of {', '.join(_CONFIGS)}")

"""A spinning lidar: its settings."""

from pydantic import Field

from hgs_core.config.base import StrictConfig


class LidarConfig(StrictConfig):
    """A lidar on the robot's axis, level; the defaults are those of a Velodyne VLP-16 at 10 Hz."""

    n_rings: int = Field(16, ge=1)
    """Rays above each other, evenly spread over the elevations."""
    lowest_deg: float = Field(-15.0, gt=-90, lt=90)
    """Elevation of the lowest ring [degrees]."""
    highest_deg: float = Field(15.0, gt=-90, lt=90)
    """Elevation of the highest ring [degrees]."""
    azimuth_step_deg: float = Field(0.2, gt=0, le=10)
    """Between two columns [degrees]; counted over the full circle, the nearest whole number of columns."""
    range_m: float = Field(100.0, gt=0)
    """Farthest distance that is measured [m]."""
    nearest_m: float = Field(0.4, ge=0)
    """Nearest distance that is measured [m]."""
    noise_m: float = Field(0.03, ge=0)
    """Standard deviation of the normal error of each range [m]."""
    mount_height_m: float = Field(1.2, gt=0)
    """Height of the optical centre above the floor [m]."""
    interval_s: float = Field(0.1, gt=0)
    """Time of a turn [s]."""

"""The planar safety scanner: its settings."""

from pydantic import Field

from hgs_core.config.base import StrictConfig


class ScannerConfig(StrictConfig):
    """A 360-degree scanner in the plane of the floor, as safety-rated vehicles carry."""

    mount_height_m: float = Field(0.15, gt=0)
    """Height of the scan plane above the floor [m]."""
    range_m: float = Field(5.0, gt=0)
    """Farthest distance that is measured [m]."""
    n_rays: int = Field(720, ge=4)
    """Rays per turn, evenly spread."""
    noise_m: float = Field(0.02, ge=0)
    """Half-width of the uniform error of each range [m]."""

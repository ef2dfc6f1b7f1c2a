"""What the service is told at its start."""

from __future__ import annotations

import ipaddress
import os
from pathlib import Path

from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.errors import ConfigError


class SupervisionSettings(StrictConfig):
    """How long the service waits for a mission process before it takes the next, harder step."""

    start_s: float = Field(180.0, gt=0)
    """From the start of the process to its first event [s]."""
    stop_acknowledged_s: float = Field(30.0, gt=0)
    """From STOP to the process having read it; after that it is terminated [s]."""
    finish_s: float = Field(900.0, gt=0)
    """From a read STOP to the written report [s]."""
    terminate_s: float = Field(5.0, gt=0)
    """From terminate (SIGTERM) to kill (SIGKILL) [s]."""
    shutdown_s: float = Field(15.0, gt=0)
    """How long a closing service waits for its mission to write its folder [s]."""
    orphan_s: float = Field(15.0, gt=0)
    """How long a mission process lives on after the service died [s]."""


class DisplaySettings(StrictConfig):
    """What a viewer is shown, and how often."""

    interval_s: float = Field(1.0, ge=0.05)
    """Least wall time between two views [s]."""
    max_splats: int = Field(100_000, ge=1_000, le=150_000)
    """Gaussians shown at once; of a larger map every k-th is shown, enlarged to close the gaps."""
    min_splat_m: float = Field(0.015, gt=0)
    """Least radius of a shown splat [m]: smaller ones would vanish from afar."""
    max_image_width: int = Field(640, ge=64)
    """Images shown are no wider than this [px]."""
    clip_height_m: float = Field(2.2, gt=0)
    """Splats above this height are hidden at first, so that the ceiling does not cover the rooms [m]."""


class Settings(StrictConfig):
    """Everything `create_app` needs."""

    data_dir: Path
    """Where missions, their results and logs lie."""
    scenes_dir: Path | None = None
    """Folder of meshes offered beside the built-in scenes."""
    host: str = "127.0.0.1"
    port: int = Field(8000, ge=0, le=65535)
    demo: bool = False
    """Start a mission in the built-in house as soon as the service is up."""
    demo_preset: str = "paper"
    viewer: bool = True
    """Serve the 3D viewer."""
    mission_threads: int = Field(default_factory=lambda: os.cpu_count() or 1, ge=1)
    """Threads that a mission process may use."""
    supervision: SupervisionSettings = SupervisionSettings()
    display: DisplaySettings = DisplaySettings()

    @property
    def missions_dir(self) -> Path:
        return self.data_dir / "missions"


def settings_from_environment(*, host: str, port: int, data_dir: Path, demo: bool) -> Settings:
    """The given options, and `HGS_SCENES_DIR`. Raises `ConfigError` for what is not allowed."""
    scenes = os.environ.get("HGS_SCENES_DIR")
    if scenes and not Path(scenes).is_dir():
        raise ConfigError(f"HGS_SCENES_DIR={scenes!r} is not a folder")
    require_loopback(host)
    return Settings(
        host=host,
        port=port,
        data_dir=data_dir.expanduser().resolve(),
        demo=demo,
        scenes_dir=Path(scenes).resolve() if scenes else None,
    )


def require_loopback(host: str) -> None:
    """Raise `ConfigError` unless `host` can be reached from this machine alone."""
    try:
        loopback = host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        loopback = False
    if not loopback:
        raise ConfigError(
            f"will not listen on {host!r}: this service has no access control yet, so it answers this "
            "machine only. Use 127.0.0.1, and `ssh -L 8000:127.0.0.1:8000 HOST` to reach it from elsewhere"
        )


def static_root() -> Path:
    """`frontend_static/` of the checkout, or its copy inside the installed package."""
    package = Path(__file__).resolve().parent
    for root in (package.parent / "frontend_static", package / "frontend_static"):
        if (root / "index.html").is_file():
            return root
    raise ConfigError(f"no operator page beside {package}: reinstall the package")

"""What a finished run's folder says about the run: its scene, its start and its settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from hgs_core.config.presets import load_yaml
from hgs_core.errors import ConfigError
from hgs_core.mission.config import MissionConfig, changed
from hgs_core.scene.scene import Scene, open_scene

RUN_CONFIG: Final = "config.yaml"


@dataclass(frozen=True, kw_only=True)
class FinishedRun:
    """A folder that `hgs run` left behind."""

    folder: Path
    scene: str
    """Name or path, as it was given."""
    start_xy: tuple[float, float]
    """Where the robot started, in the world [m]."""
    config: MissionConfig

    @staticmethod
    def open(folder: Path, overrides: Mapping[str, str] | None = None) -> FinishedRun:
        """Read the run in `folder`, with `key.sub=value` changes to its settings.

        Raises `ConfigError` naming what is missing or wrong.
        """
        if not folder.is_dir():
            raise ConfigError(f"{folder} is not a folder: give one that `hgs run` left behind")
        path = folder / RUN_CONFIG
        if not path.is_file():
            raise ConfigError(f"{path} is missing: not a folder that `hgs run` left behind")
        content = load_yaml(path)
        scene, mission, start_xy = content.get("scene"), content.get("mission"), _start_xy(content)
        if not isinstance(scene, str) or not isinstance(mission, dict) or start_xy is None:
            raise ConfigError(f"{path} must hold scene, start (x_m, y_m) and mission, as `hgs run` writes it")
        config = changed(mission, dict(overrides or {}), source=str(path))
        return FinishedRun(folder=folder, scene=scene, start_xy=start_xy, config=config)

    def open_scene(self) -> Scene:
        """The run's scene, opened again. Raises `SceneError` where it is gone."""
        robot = self.config.robot
        return open_scene(self.scene, self.config.scene, radius_m=robot.radius_m, height_m=robot.height_m)


def _start_xy(content: dict[str, Any]) -> tuple[float, float] | None:
    start = content.get("start")
    if not isinstance(start, dict):
        return None
    x_m, y_m = start.get("x_m"), start.get("y_m")
    if not isinstance(x_m, int | float) or not isinstance(y_m, int | float):
        return None
    return float(x_m), float(y_m)

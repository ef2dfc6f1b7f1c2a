"""What a finished run's folder says about the run: its scene, its start and its settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import yaml

from hgs_core.config.presets import load_yaml
from hgs_core.errors import ConfigError
from hgs_core.mission.config import MissionConfig, changed
from hgs_core.mission.folder import PARTIAL_SUFFIX, is_complete, partial_of
from hgs_core.mission.request import MissionRequest
from hgs_core.mission.versions import software_versions
from hgs_core.scene.free_floor import StartPose
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
    preset: str = ""
    """Its preset's name; empty in runs of earlier versions."""
    planner: str = ""
    """Its planner's name, or its preset's."""
    seed: int = 0
    extends: str | None = None
    """Folder of the run whose maps it began with."""

    @staticmethod
    def is_described(folder: Path) -> bool:
        """Whether a run in `folder` got as far as to say what it is."""
        return (folder / RUN_CONFIG).is_file()

    def asked_for(self) -> dict[str, Any]:
        """What was asked of the mission besides its settings, by the names of `MissionRequest`."""
        return {
            "scene": self.scene,
            "preset": self.preset,
            "planner": self.planner,
            "seed": self.seed,
            "extends": None if self.extends is None else Path(self.extends),
        }

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
        return FinishedRun(
            folder=folder,
            scene=scene,
            start_xy=start_xy,
            config=config,
            preset=str(content.get("preset", "")),
            planner=str(content.get("planner", "")),
            seed=int(content.get("seed", 0)),
            extends=content.get("extends"),
        )

    def open_scene(self) -> Scene:
        """The run's scene, opened again. Raises `SceneError` where it is gone."""
        robot = self.config.robot
        return open_scene(self.scene, self.config.scene, radius_m=robot.radius_m, height_m=robot.height_m)


def resuming_request(out: Path) -> MissionRequest:
    """The request that goes on with the run for `out` that was killed or suspended.

    Raises `ConfigError` where there is none.
    """
    out = out.with_name(out.name.removesuffix(PARTIAL_SUFFIX))
    partial = partial_of(out)
    if is_complete(out):
        raise ConfigError(f"{out} is complete: there is nothing to go on with")
    if not partial.is_dir():
        raise ConfigError(f"there is no {partial}: no run for {out} was begun and broke off")
    if not FinishedRun.is_described(partial):
        raise ConfigError(
            f"the run in {partial} had not begun when it broke off: remove it, and run it again"
        )
    begun = FinishedRun.open(partial)
    return MissionRequest(out=out, max_time_s=None, overrides={}, resume=True, **begun.asked_for())


def write_run_config(folder: Path, request: MissionRequest, config: MissionConfig, start: StartPose) -> None:
    """Write `config.yaml`, whole or not at all."""
    content = {
        "scene": request.scene,
        "preset": request.preset,
        "planner": request.planner or request.preset,
        "seed": request.seed,
        "extends": None if request.extends is None else str(request.extends.resolve()),
        "start": {"x_m": start.x_m, "y_m": start.y_m, "yaw_rad": start.yaw_rad},
        "versions": software_versions(),
        "mission": config.model_dump(mode="json"),
    }
    partial = folder / f"{RUN_CONFIG}.partial"
    partial.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    partial.replace(folder / RUN_CONFIG)


def _start_xy(content: dict[str, Any]) -> tuple[float, float] | None:
    start = content.get("start")
    if not isinstance(start, dict):
        return None
    x_m, y_m = start.get("x_m"), start.get("y_m")
    if not isinstance(x_m, int | float) or not isinstance(y_m, int | float):
        return None
    return float(x_m), float(y_m)

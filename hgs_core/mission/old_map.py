"""What a finished run leaves for another to begin with: `hgs run --extend`.

`map.ply` and the keyframes are there for everybody. What only a mission needs is kept beside them in
`exploration.npz`: the voxels, which know what was seen and what was looked at in vain, and the planner's
memory of the views that were taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from hgs_core.errors import CheckpointError, ConfigError
from hgs_core.evaluation.trajectory import read_trajectory
from hgs_core.gaussians.ply import read_ply
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.keyframe_archive import KeyframeArchive
from hgs_core.mapping.mapper import Mapper
from hgs_core.mapping.transforms import TRANSFORMS
from hgs_core.mission.config import MissionConfig
from hgs_core.mission.finished_run import FinishedRun
from hgs_core.mission.state_file import StateWriter, read_state
from hgs_core.planning.plan import Planner
from hgs_core.voxels.voxel_map import VoxelMap

EXPLORATION: Final = "exploration.npz"
_FORMAT: Final = 1
_MUST_AGREE: Final = ("scene", "sensor", "voxels")
"""Sections of the settings that the maps depend on, besides the primitive."""


def write_exploration(folder: Path, config: MissionConfig, mapper: Mapper, planner: Planner) -> None:
    """Write `exploration.npz` into a run's folder, compressed, whole or not at all."""
    state = {
        "format": _FORMAT,
        "voxels": mapper.voxels.state(),
        "planner_config": config.planner.model_dump(mode="json"),
        "planner": planner.state(),
    }
    partial = folder / f"{EXPLORATION}.partial"
    with partial.open("wb") as file:
        writer = StateWriter(file, compressed=True)
        try:
            writer.write(state)
            writer.close()
        except BaseException:
            writer.abandon()
            partial.unlink()
            raise
    partial.replace(folder / EXPLORATION)


@dataclass(frozen=True, kw_only=True, eq=False)
class OldMap:
    """A finished run that another one begins with."""

    run: FinishedRun
    keyframes: KeyframeArchive
    state: dict[str, Any]

    @staticmethod
    def check(folder: Path, scene: str, config: MissionConfig) -> FinishedRun:
        """The run in `folder`, which a mission in `scene` can begin with.

        Raises `ConfigError` for a folder that is no finished run's, one that keeps no voxels, or one of
        another scene or settings.
        """
        run = FinishedRun.open(folder)
        differences = list(_differences(run, scene, config))
        if differences:
            raise ConfigError(f"cannot extend the map in {folder}: {'; '.join(differences)}")
        if not (folder / EXPLORATION).is_file():
            raise ConfigError(f"{folder / EXPLORATION} is missing: this run keeps no voxels (any more)")
        return run

    @staticmethod
    def open(folder: Path, scene: str, config: MissionConfig) -> OldMap:
        """Raises `ConfigError` as `check` does, or for a damaged file, and `MapError` where the run's
        keyframes are gone."""
        run = OldMap.check(folder, scene, config)
        try:
            state = read_state(folder / EXPLORATION)
        except CheckpointError as error:
            raise ConfigError(f"cannot extend the map in {folder}: {error}") from error
        if state.get("format") != _FORMAT:
            raise ConfigError(
                f"{folder / EXPLORATION} has format {state.get('format')}, expected {_FORMAT}: "
                "it was written by another version of hgs"
            )
        return OldMap(run=run, keyframes=KeyframeArchive.open(folder), state=state)

    def begin(self, mapper: Mapper, planner: Planner, config: MissionConfig) -> None:
        """Let a mission that has not begun know what this run knew. A planner of other settings than the
        run's begins without its memory."""
        mapper.begin_with(
            read_ply(self.run.folder / "map.ply"),
            VoxelMap.restore(self.state["voxels"]),
            self.keyframes,
            seen_from=training_poses(self.run.folder),
        )
        if self.state["planner_config"] == config.planner.model_dump(mode="json"):
            planner.restore(self.state["planner"])


def training_poses(folder: Path) -> SE3:
    """`T_world_camera`, batched, of the frames that the map of a finished run has learnt from: all of its
    mission, and the keyframes that it began with, which lie before its time."""
    frames = read_trajectory(folder / "trajectory.txt").poses
    if not (folder / TRANSFORMS).is_file():
        return frames
    keyframes = KeyframeArchive.open(folder)
    earlier = keyframes.timestamps_s < 0
    return SE3(
        rotation=np.concatenate([keyframes.poses.rotation[earlier], frames.rotation]),
        translation=np.concatenate([keyframes.poses.translation[earlier], frames.translation]),
    )


def _differences(run: FinishedRun, scene: str, config: MissionConfig) -> Iterator[str]:
    if _named(run.scene) != _named(scene):
        yield f"it is of the scene {run.scene}, not {scene}"
    here, there = config.model_dump(mode="json"), run.config.model_dump(mode="json")
    for section in _MUST_AGREE:
        yield from _different(section, there[section], here[section])
    yield from _different("mapping.primitive", run.config.mapping.primitive, config.mapping.primitive)


def _named(scene: str) -> str:
    return str(Path(scene).resolve()) if Path(scene).exists() else scene


def _different(name: str, there: Any, here: Any) -> Iterator[str]:
    if isinstance(there, dict) and isinstance(here, dict):
        for key in sorted(there.keys() | here.keys()):
            yield from _different(f"{name}.{key}", there.get(key), here.get(key))
    elif there != here:
        yield f"{name} is {there} there and {here} here"

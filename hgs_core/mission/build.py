"""The composition root: from a preset, a scene (or a robot) and a seed to a mission ready to run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hgs_core.errors import ConfigError
from hgs_core.geometry.boxes import Box
from hgs_core.live.world import LiveWorld
from hgs_core.localisation.given import GivenConfig
from hgs_core.mapping.mapper import Mapper
from hgs_core.mission.clock import Clock, clock_of
from hgs_core.mission.commands import CommandSource
from hgs_core.mission.config import MissionConfig
from hgs_core.mission.curve_recorder import CurveRecorder
from hgs_core.mission.events import MissionObserver
from hgs_core.mission.live_clock import LiveClock
from hgs_core.mission.mission import Mission
from hgs_core.mission.old_map import OldMap
from hgs_core.planning.navigator import Navigator
from hgs_core.planning.plan import Planner
from hgs_core.planning.registry import build_planner
from hgs_core.planning.survey import PlannerContext
from hgs_core.robot.vehicle import vehicle_of
from hgs_core.scene.free_floor import StartPose
from hgs_core.scene.scene import Scene, open_scene
from hgs_core.sensing.frame import Frame
from hgs_core.simulation.world import SimulatedWorld

_REGION_MARGIN_M = 0.2


@dataclass(frozen=True, kw_only=True, eq=False)
class MissionParts:
    """A mission and what its report needs of the world that it runs in."""

    name: str
    """Of the scene, or of the robot."""

    scene: Scene | None
    """The truth, where it is known: that of a simulated world."""
    world: SimulatedWorld | LiveWorld
    mapper: Mapper
    mission: Mission
    planner: Planner
    curve: CurveRecorder | None
    """Records how complete the map is meanwhile, where that is wanted."""

    @property
    def start(self) -> StartPose:
        """Where the mission began; of a robot that was resumed, where it is."""
        if self.scene is not None:
            return self.scene.start
        here = self.world.robot.state
        return StartPose(x_m=here.x_m, y_m=here.y_m, yaw_rad=here.yaw_rad)

    def state(self) -> dict[str, Any]:
        """Everything that the rest of the mission depends on, to be taken between two frames."""
        return {
            "mission": self.mission.state(),
            "world": self.world.state(),
            "curve": None if self.curve is None else self.curve.state(),
        }

    def restore(self, state: dict[str, Any], *, keyframe_folder: Path) -> None:
        """For parts of the same settings, scene and seed."""
        self.world.restore(state["world"])
        self.mission.restore(state["mission"], keyframe_folder=keyframe_folder)
        if self.curve is not None and state["curve"] is not None:
            self.curve.restore(state["curve"])


def build_mission(
    config: MissionConfig,
    scene_source: str,
    seed: int,
    keyframe_folder: Path,
    *,
    observer: MissionObserver,
    commands: CommandSource,
    why_wait: Callable[[], str | None] = lambda: None,
    old_map: OldMap | None = None,
    live: LiveWorld | None = None,
) -> MissionParts:
    """Open the scene, unless the world is a `live` one, and put everything together. The only place that
    knows both maps and simulator.

    The region to explore is the scene's bounding box, as an operator would give it; the planner knows
    nothing else of the scene. Raises `SceneError` when the scene cannot serve, and `ConfigError` for a
    localisation other than `given`: a simulated camera knows where it is.
    """
    if live is None and not isinstance(config.localisation, GivenConfig):
        raise ConfigError(
            f"localisation.method = {config.localisation.method!r}: a simulated mission has the simulator's "
            "poses; set it to given, or measure the method with `hgs bench localisation`"
        )
    world_seeds, mapper_seed, planner_seed = np.random.SeedSequence(seed).spawn(3)
    far_side = _simulated(config, scene_source, world_seeds) if live is None else _lived(live, config)
    scene, world, region, clock = far_side.scene, far_side.world, far_side.region, far_side.clock
    mapper = build_mapper(
        config, region=region, keyframe_folder=keyframe_folder, rng=np.random.default_rng(mapper_seed)
    )
    context = PlannerContext(
        robot=config.robot,
        camera=config.sensor.camera.intrinsics(),
        camera_height_m=config.sensor.camera.mount_height_m,
        camera_range_m=config.sensor.camera.range_m,
        region=region,
    )
    curve = None
    if config.curve_interval_m > 0 and scene is not None:
        observer = curve = CurveRecorder.of(scene, config, mapper=mapper, clock=clock, observer=observer)
    planner = build_planner(config.planner, context)
    if old_map is not None:
        old_map.begin(mapper, planner, config)
    mission = Mission(
        robot=world.robot,
        vehicle=vehicle_of(config.robot),
        sensor=world.camera,
        scanner=world.scanner,
        mapper=mapper,
        planner=planner,
        planner_rng=np.random.default_rng(planner_seed),
        limits=config.limits,
        clock=clock,
        observer=observer,
        commands=commands,
        navigator=Navigator(config.planner, config.robot),
        directives=config.directives,
        why_wait=why_wait if live is None else lambda: live.why_wait() or why_wait(),
        why_over=_never if live is None else lambda: live.over,
        on_mapped=_nobody if live is None else live.mapped,
    )
    return MissionParts(
        name=far_side.name,
        scene=scene,
        world=world,
        mapper=mapper,
        mission=mission,
        planner=planner,
        curve=curve,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _FarSide:
    """What lies behind the seams, and the time that passes there."""

    name: str
    scene: Scene | None
    world: SimulatedWorld | LiveWorld
    region: Box | None
    clock: Clock


def _simulated(config: MissionConfig, source: str, seeds: np.random.SeedSequence) -> _FarSide:
    scene = open_scene(source, config.scene, radius_m=config.robot.radius_m, height_m=config.robot.height_m)
    world = SimulatedWorld.of(
        scene,
        robot=config.robot,
        camera=config.sensor.camera,
        scanner=config.sensor.scanner,
        seeds=seeds,
    )
    return _FarSide(
        name=scene.name,
        scene=scene,
        world=world,
        region=scene.bounds.expanded(_REGION_MARGIN_M),
        clock=clock_of(config.clock, config.sensor.camera.frame_interval_s),
    )


def _lived(world: LiveWorld, config: MissionConfig) -> _FarSide:
    clock = LiveClock(world.correspondence, config.sensor.camera.frame_interval_s)
    return _FarSide(name=world.name, scene=None, world=world, region=world.region, clock=clock)


def _never() -> str | None:
    return None


def _nobody(_: Frame) -> None:
    """Nobody asks."""


def build_mapper(
    config: MissionConfig, *, region: Box | None, keyframe_folder: Path, rng: np.random.Generator
) -> Mapper:
    """A mapper that has seen nothing, with the settings and the sensors' ranges of a mission."""
    return Mapper(
        config.mapping,
        config.voxels,
        camera_range_m=config.sensor.camera.range_m,
        scanner_range_m=config.sensor.scanner.range_m,
        region=region,
        keyframe_folder=keyframe_folder,
        rng=rng,
        correctable=not isinstance(config.localisation, GivenConfig),  # given poses do not drift
    )

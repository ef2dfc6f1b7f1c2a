"""`hgs bench ablation`: what each mechanism of the mapper is worth, on the way that a finished run took."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from hgs_core.benchmark.map_quality import MapQuality, MapTruth
from hgs_core.errors import ConfigError
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.config import MappingConfig
from hgs_core.mission.build import build_mapper
from hgs_core.mission.config import MissionConfig
from hgs_core.native import kernels
from hgs_core.scene.scene import Scene
from hgs_core.sensing.depth_camera import with_uniform_noise
from hgs_core.sensing.frame import Frame

AS_IT_IS: Final = "as it is"

ABLATIONS: Final[dict[str, dict[str, Any]]] = {
    AS_IT_IS: {},
    "isotropic Gaussians": {"primitive": "isotropic"},
    "no optimisation": {"iterations_per_s": 0.0},
    "depth not smoothed": {"fusion": {"smoothing_radius_px": 0}},
    "centres follow the newest depth": {"fusion": {"max_observations": 1}},
    "centres not optimised": {"rates": {"centre": 0.0}},
    "coarse Gaussians stay": {"insertion": {"replace_factor": 1e6}},
    "one Gaussian a pixel at most": {"insertion": {"grazing_pitch": 1.0}},
    "plain walls as dense as detail": {"insertion": {"widest_factor": 1.0}},
    "no loss of depth": {"loss": {"depth": 0.0}},
    "no loss of silhouette": {"loss": {"silhouette": 0.0}},
    "no loss of free space": {"loss": {"free": 0.0}},
    "newest frame alone": {"current_frame_share": 1.0, "replay_share": 0.0},
}
"""What is switched off, and by which fields of `MappingConfig`."""

_NOISE_SEED: Final = 2
_MAPPER_SEED: Final = 1


class AblationRow(MapQuality):
    """One map of the same frames."""

    name: str
    mapping_s_per_frame: float
    """Wall seconds: of other loads on the machine as well."""


def run_ablation(
    config: MissionConfig,
    scene: Scene,
    poses: SE3,
    *,
    start_xy: tuple[float, float],
    every: int,
    names: Sequence[str],
    progress: Callable[[str], None],
) -> list[AblationRow]:
    """Map every `every`-th of `poses` (batched `T_world_camera`) once as `config` says, and for each name.

    A frame that stands for several gets the optimisation steps of all of them. The way is that of a finished
    run, so all maps see the same frames with the same noise. Raises `ConfigError` for a name that is not in
    `ABLATIONS`.
    """
    unknown = [name for name in names if name not in ABLATIONS]
    if unknown:
        raise ConfigError(f"no ablation {unknown[0]!r}; there are: {', '.join(ABLATIONS)}")
    kernels.set_threads(config.threads)
    taken = poses[::every]
    progress("the truth that all maps are compared with")
    truth = MapTruth.of(config, scene, taken, start_xy)
    rows = []
    for name in dict.fromkeys([AS_IT_IS, *names]):
        mapping = _varied(config.mapping, ABLATIONS[name], every)

        def report(message: str, name: str = name) -> None:
            progress(f"{name}: {message}")

        with tempfile.TemporaryDirectory(prefix="hgs-bench-") as folder:
            gaussians, seconds = _map(config, mapping, scene, taken, Path(folder), report)
        report("comparing")
        quality = truth.quality_of(gaussians)
        rows.append(AblationRow(name=name, mapping_s_per_frame=seconds, **quality.model_dump()))
    return rows


def _varied(mapping: MappingConfig, changes: dict[str, Any], every: int) -> MappingConfig:
    content = mapping.model_dump()
    content["iterations_per_s"] *= every
    for key, value in changes.items():
        content[key] = {**content[key], **value} if isinstance(value, dict) else value
    return MappingConfig.model_validate(content)


def _map(
    config: MissionConfig,
    mapping: MappingConfig,
    scene: Scene,
    taken: SE3,
    folder: Path,
    progress: Callable[[str], None],
) -> tuple[GaussianMap, float]:
    """The map of all frames, and mean wall seconds of mapping for one."""
    camera, n_frames = config.sensor.camera, len(taken.translation)
    mapper = build_mapper(
        config.model_copy(update={"mapping": mapping}),
        region=None,
        keyframe_folder=folder / "keyframes",
        rng=np.random.default_rng(_MAPPER_SEED),
    )
    noise = np.random.default_rng(_NOISE_SEED)
    busy_s = 0.0
    for number in range(n_frames):
        pose = taken[number]
        rgb, depth_m = scene.caster.render(camera.intrinsics(), pose, camera.range_m)
        frame = Frame(
            rgb=rgb,
            depth_m=with_uniform_noise(depth_m, camera.depth_noise_m, noise),
            intrinsics=camera.intrinsics(),
            T_world_camera=pose,
            timestamp_s=(number + 1) * camera.frame_interval_s,
            sequence=number,
        )
        began = time.perf_counter()
        mapper.integrate(frame)
        mapper.optimise(interrupted=lambda: False)
        busy_s += time.perf_counter() - began
        if number % 10 == 0:
            progress(f"frame {number + 1} of {n_frames}")
    mapper.prune()
    return mapper.gaussians, busy_s / max(n_frames, 1)

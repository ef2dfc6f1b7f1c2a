"""`hgs bench ablation`: what each mechanism of the mapper is worth, on the way that a finished run took."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from jaxtyping import Bool
from numpy import ndarray
from pydantic import BaseModel, ConfigDict

from hgs_core.errors import ConfigError
from hgs_core.evaluation.ceiling import ObservableCeiling, observable_ceiling
from hgs_core.evaluation.held_out import held_out_poses, observed_masks
from hgs_core.evaluation.images import masked_mean, psnr_db, ssim_map
from hgs_core.evaluation.surface import surface_metrics
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.render import render
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.config import MappingConfig
from hgs_core.mission.build import build_mapper
from hgs_core.mission.ceiling import ceiling_request
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
    "plain walls as dense as detail": {"insertion": {"widest_factor": 1.0}},
    "no loss of depth": {"loss": {"depth": 0.0}},
    "no loss of silhouette": {"loss": {"silhouette": 0.0}},
    "no loss of free space": {"loss": {"free": 0.0}},
    "newest frame alone": {"current_frame_share": 1.0, "replay_share": 0.0},
}
"""What is switched off, and by which fields of `MappingConfig`."""

_MIN_MASK_SHARE: Final = 0.01
_NOISE_SEED: Final = 2
_MAPPER_SEED: Final = 1


class AblationRow(BaseModel):
    """One map of the same frames."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    name: str
    psnr_db: float
    """Over the observed part of 40 held-out views, as in a mission's report; likewise below."""
    ssim: float
    median_depth_error_cm: float
    accuracy_cm: float
    completion_cm_observable: float
    completion_ratio_observable: float
    n_gaussians: int
    mapping_s_per_frame: float
    """Wall seconds: of other loads on the machine as well."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Truth:
    """What every map is compared with, found once."""

    ceiling: ObservableCeiling
    poses: SE3
    masks: Bool[ndarray, "n_views height width"]


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
    truth = _truth(config, scene, taken, start_xy)
    rows = []
    for name in dict.fromkeys([AS_IT_IS, *names]):
        mapping = _varied(config.mapping, ABLATIONS[name], every)

        def report(message: str, name: str = name) -> None:
            progress(f"{name}: {message}")

        with tempfile.TemporaryDirectory(prefix="hgs-bench-") as folder:
            gaussians, seconds = _map(config, mapping, scene, taken, Path(folder), report)
        report("comparing")
        rows.append(_measure(name, config, scene, truth, gaussians, seconds))
    return rows


def _varied(mapping: MappingConfig, changes: dict[str, Any], every: int) -> MappingConfig:
    content = mapping.model_dump()
    content["iterations_per_s"] *= every
    for key, value in changes.items():
        content[key] = {**content[key], **value} if isinstance(value, dict) else value
    return MappingConfig.model_validate(content)


def _truth(config: MissionConfig, scene: Scene, taken: SE3, start_xy: tuple[float, float]) -> _Truth:
    camera = config.sensor.camera
    ceiling = observable_ceiling(scene.caster, ceiling_request(config, start_xy))
    poses = held_out_poses(ceiling.positions_m, camera_height_m=camera.mount_height_m)
    masks = observed_masks(
        scene.caster,
        poses=poses,
        training_poses=taken,
        intrinsics=camera.intrinsics(),
        range_m=camera.range_m,
    )
    return _Truth(ceiling=ceiling, poses=poses, masks=masks)


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


def _measure(
    name: str, config: MissionConfig, scene: Scene, truth: _Truth, gaussians: GaussianMap, seconds: float
) -> AblationRow:
    intrinsics = config.sensor.camera.intrinsics()
    pictures, depth_errors = [], []
    for index, mask in enumerate(truth.masks):
        if mask.mean() < _MIN_MASK_SHARE:
            continue
        pose = truth.poses[index]
        true_rgb, true_depth_m = scene.caster.render(intrinsics, pose)
        reference = true_rgb.astype(np.float32) / np.float32(255.0)
        view = render(gaussians, intrinsics, pose)
        colour = np.clip(view.colour, 0.0, 1.0)
        pictures.append((psnr_db(colour, reference, mask), masked_mean(ssim_map(colour, reference), mask)))
        depth_errors.append(np.abs(view.depth_m - true_depth_m)[mask & np.isfinite(true_depth_m)])
    surface = surface_metrics(
        gaussians.centres_m,
        samples=truth.ceiling.samples_m,
        observable=truth.ceiling.observable,
        distance_to_surface=scene.caster.distance_to_surface,
    )
    psnr, ssim = np.mean(pictures, axis=0)
    return AblationRow(
        name=name,
        psnr_db=float(psnr),
        ssim=float(ssim),
        median_depth_error_cm=float(np.median(np.concatenate(depth_errors))) * 100,
        accuracy_cm=surface.accuracy_cm,
        completion_cm_observable=surface.completion_cm_observable,
        completion_ratio_observable=surface.completion_ratio_observable,
        n_gaussians=gaussians.size,
        mapping_s_per_frame=seconds,
    )

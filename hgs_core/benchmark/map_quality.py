"""How good a map of a known scene is: the figures that benchmarks compare maps by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Bool
from numpy import ndarray
from pydantic import BaseModel, ConfigDict

from hgs_core.evaluation.ceiling import ObservableCeiling, observable_ceiling
from hgs_core.evaluation.held_out import held_out_poses, observed_masks
from hgs_core.evaluation.images import masked_mean, psnr_db, ssim_map
from hgs_core.evaluation.surface import surface_metrics
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.render import render
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3
from hgs_core.mission.ceiling import ceiling_request
from hgs_core.mission.config import MissionConfig
from hgs_core.scene.scene import Scene

_MIN_MASK_SHARE: Final = 0.01


class MapQuality(BaseModel):
    """One map against the true scene."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    psnr_db: float
    """Over the observed part of 40 held-out views, as in a mission's report; likewise below."""
    ssim: float
    median_depth_error_cm: float
    accuracy_cm: float
    completion_cm_observable: float
    completion_ratio_observable: float
    n_gaussians: int


@dataclass(frozen=True, kw_only=True, eq=False)
class MapTruth:
    """What maps of one scene are compared with, found once."""

    scene: Scene
    intrinsics: CameraIntrinsics
    ceiling: ObservableCeiling
    poses: SE3
    masks: Bool[ndarray, "n_views height width"]

    @staticmethod
    def of(config: MissionConfig, scene: Scene, seen_from: SE3, start_xy: tuple[float, float]) -> MapTruth:
        """`seen_from` are the true poses (batched `T_world_camera`) of the frames that are mapped.

        Raises `SceneError` when the start is not free.
        """
        camera = config.sensor.camera
        ceiling = observable_ceiling(scene.caster, ceiling_request(config, start_xy))
        poses = held_out_poses(ceiling.positions_m, camera_height_m=camera.mount_height_m)
        masks = observed_masks(
            scene.caster,
            poses=poses,
            training_poses=seen_from,
            intrinsics=camera.intrinsics(),
            range_m=camera.range_m,
        )
        return MapTruth(
            scene=scene, intrinsics=camera.intrinsics(), ceiling=ceiling, poses=poses, masks=masks
        )

    def quality_of(self, gaussians: GaussianMap) -> MapQuality:
        """The figures of a map in the scene's world frame."""
        pictures, depth_errors = [], []
        for index, mask in enumerate(self.masks):
            if mask.mean() < _MIN_MASK_SHARE:
                continue
            pose = self.poses[index]
            true_rgb, true_depth_m = self.scene.caster.render(self.intrinsics, pose)
            reference = true_rgb.astype(np.float32) / np.float32(255.0)
            view = render(gaussians, self.intrinsics, pose)
            colour = np.clip(view.colour, 0.0, 1.0)
            pictures.append(
                (psnr_db(colour, reference, mask), masked_mean(ssim_map(colour, reference), mask))
            )
            depth_errors.append(np.abs(view.depth_m - true_depth_m)[mask & np.isfinite(true_depth_m)])
        surface = surface_metrics(
            gaussians.centres_m,
            samples=self.ceiling.samples_m,
            observable=self.ceiling.observable,
            distance_to_surface=self.scene.caster.distance_to_surface,
        )
        psnr, ssim = np.mean(pictures, axis=0)
        return MapQuality(
            psnr_db=float(psnr),
            ssim=float(ssim),
            median_depth_error_cm=float(np.median(np.concatenate(depth_errors))) * 100,
            accuracy_cm=surface.accuracy_cm,
            completion_cm_observable=surface.completion_cm_observable,
            completion_ratio_observable=surface.completion_ratio_observable,
            n_gaussians=gaussians.size,
        )

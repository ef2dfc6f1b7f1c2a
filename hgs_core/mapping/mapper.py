"""The mapper: the only writer of the maps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Int32
from numpy import ndarray

from hgs_core.gaussians.gaussian_map import BLOCK, LOGIT_OPACITY, GaussianMap
from hgs_core.gaussians.information import accumulate_information
from hgs_core.gaussians.optimise import optimise_step
from hgs_core.gaussians.render import render
from hgs_core.gaussians.rendered_view import RenderedView
from hgs_core.geometry.boxes import Box
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.config import MappingConfig
from hgs_core.mapping.depth_filter import training_image
from hgs_core.mapping.insertion import missing_pixels, new_gaussians, wanted_spacing
from hgs_core.mapping.keyframes import KeyframeStore, TrainingImage
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.native import kernels
from hgs_core.sensing.frame import Frame, Scan
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap, VoxelState

_RETIRED_LOGIT = -20.0
_OVERLAP_MIN = 0.2


@dataclass(frozen=True, kw_only=True)
class IntegrationReport:
    """What one frame did to the map."""

    inserted: int
    retired: int
    """Coarse Gaussians replaced by finer ones."""
    iterations: int
    keyframe: bool
    psnr_predicted_db: float
    """Of the frame against the map *before* it was learnt, over pixels the map covered; NaN if too few."""


class Mapper:
    """Turns frames and scans into a voxel map and a Gaussian map, with bounded work for each.

    A frame: integrate voxels; halve and smooth; average depth into the centres in view; replace what is too
    coarse; add what is missing; optimise a few steps on this frame and overlapping keyframes; now and then
    prune. Work follows what the camera sees, not the size of the map.
    """

    def __init__(
        self,
        config: MappingConfig,
        voxel_config: VoxelConfig,
        *,
        camera_range_m: float,
        scanner_range_m: float,
        region: Box | None,
        keyframe_folder: Path,
        rng: np.random.Generator,
    ) -> None:
        self.config = config
        self.gaussians = GaussianMap()
        self.voxels = VoxelMap(voxel_config, region=region)
        self.keyframes = KeyframeStore(keyframe_folder)
        self._camera_range_m = camera_range_m
        self._scanner_range_m = scanner_range_m
        self._rng = rng
        self._n_frames = 0
        self._timestamp_s = 0.0

    def integrate_scan(self, scan: Scan) -> None:
        self.voxels.integrate_scan(scan, range_m=self._scanner_range_m)
        self._timestamp_s = scan.timestamp_s

    def integrate(self, frame: Frame, *, interrupted: Callable[[], bool]) -> IntegrationReport:
        """Learn one frame. `interrupted` is polled between optimisation steps and ends them early."""
        self.voxels.integrate_frame(frame, range_m=self._camera_range_m)
        image = training_image(frame, self.config.fusion)
        spacing_m = wanted_spacing(image, self.config.insertion)
        retired = self._fuse_depth(image, spacing_m)
        rendered = render(self.gaussians, image.intrinsics, image.T_world_camera)
        psnr = _predicted_psnr(image, rendered)
        is_keyframe = self._is_keyframe(frame.T_world_camera)
        inserted = self._insert(image, rendered, spacing_m, anchor=len(self.keyframes) - (not is_keyframe))
        iterations = self._optimise(image, interrupted)
        accumulate_information(self.gaussians, frame.intrinsics, frame.T_world_camera)
        if is_keyframe:
            self.keyframes.add(image)
        self._n_frames += 1
        if self._n_frames % self.config.prune_interval == 0:
            self.prune()
        self._timestamp_s = frame.timestamp_s
        return IntegrationReport(
            inserted=inserted,
            retired=retired,
            iterations=iterations,
            keyframe=is_keyframe,
            psnr_predicted_db=psnr,
        )

    def snapshot(self) -> MapSnapshot:
        return MapSnapshot(
            gaussians=self.gaussians,
            voxels=self.voxels,
            version=self.gaussians.version + self.voxels.version,
            timestamp_s=self._timestamp_s,
        )

    def prune(self) -> int:
        """Drop faint Gaussians, and those that float where the voxel map saw free space. Returns how many."""
        kept = self.gaussians.opacities >= self.config.prune_opacity
        kept &= ~self._floating()
        dropped = int(len(kept) - kept.sum())
        if dropped:
            self.gaussians.keep(kept)
        else:
            self.gaussians.refresh_blocks()
        return dropped

    def state(self) -> dict[str, Any]:
        return {
            "gaussians": self.gaussians.state(),
            "voxels": self.voxels.state(),
            "keyframes": self.keyframes.state(),
            "rng": self._rng.bit_generator.state,
            "n_frames": self._n_frames,
            "timestamp_s": self._timestamp_s,
        }

    def restore(self, state: dict[str, Any], *, keyframe_folder: Path) -> None:
        self.gaussians = GaussianMap.restore(state["gaussians"])
        self.voxels = VoxelMap.restore(state["voxels"])
        self.keyframes = KeyframeStore.restore(keyframe_folder, state["keyframes"])
        self._rng.bit_generator.state = state["rng"]
        self._n_frames = state["n_frames"]
        self._timestamp_s = state["timestamp_s"]

    def _fuse_depth(self, image: TrainingImage, spacing_m: Float32[ndarray, "height width"]) -> int:
        """Average this depth into the centres in view; retire those that this view would place much finer."""
        fusion, insertion = self.config.fusion, self.config.insertion
        size, camera = self.gaussians.size, image.intrinsics
        if size == 0:
            return 0
        coarse: Int32[ndarray, " n"] = kernels.fuse_centres(
            self.gaussians.parameters[:size],
            self.gaussians.n_depth_observations[:size],
            self.gaussians.block_bounds,
            BLOCK,
            image.depth_m,
            np.float32(insertion.replace_factor * insertion.radius_factor) * spacing_m,
            camera.fx,
            camera.fy,
            camera.cx,
            camera.cy,
            np.ascontiguousarray(image.T_world_camera.rotation, np.float32),
            np.ascontiguousarray(image.T_world_camera.translation, np.float32),
            gate_m=fusion.gate_m,
            gate_slope=fusion.gate_slope,
            max_count=fusion.max_observations,
        )
        self.gaussians.parameters[coarse, LOGIT_OPACITY] = _RETIRED_LOGIT
        self.gaussians.version += 1
        return len(coarse)

    def _insert(
        self,
        image: TrainingImage,
        rendered: RenderedView,
        spacing_m: Float32[ndarray, "height width"],
        *,
        anchor: int,
    ) -> int:
        coarsening = self._coarsening()
        if coarsening is None:
            return 0
        wanted = missing_pixels(image, rendered, self.config.insertion)
        parameters = new_gaussians(image, wanted, np.float32(coarsening) * spacing_m, self.config.insertion)
        room = self.config.max_gaussians - self.gaussians.size
        self.gaussians.append(parameters[:room], anchor_keyframe=anchor)
        return min(len(parameters), room)

    def _coarsening(self) -> int | None:
        """How much coarser than usual to insert as the budget runs out; None when it is spent."""
        used = self.gaussians.size / self.config.max_gaussians
        if used >= 1.0:
            return None
        if used > 0.95:
            return 4
        return 2 if used > 0.85 else 1

    def _optimise(self, image: TrainingImage, interrupted: Callable[[], bool]) -> int:
        overlap = self.keyframes.overlap(image, range_m=self._camera_range_m)
        neighbours = np.flatnonzero(overlap > _OVERLAP_MIN)
        for step in range(self.config.iterations_per_frame):
            if interrupted():
                return step
            target = self._target(image, neighbours)
            optimise_step(
                self.gaussians,
                target.rgb,
                target.depth_m,
                target.intrinsics,
                target.T_world_camera,
                weights=self.config.loss,
                rates=self.config.rates,
            )
        return self.config.iterations_per_frame

    def _target(self, image: TrainingImage, neighbours: Int[ndarray, " n"]) -> TrainingImage:
        """What one step learns from: the newest frame, a keyframe that overlaps it, or any keyframe."""
        draw = self._rng.random()
        if len(self.keyframes) and draw >= 1.0 - self.config.replay_share:
            return self.keyframes.load(int(self._rng.integers(len(self.keyframes))))
        if len(neighbours) and draw >= self.config.current_frame_share:
            return self.keyframes.load(int(self._rng.choice(neighbours)))
        return image

    def _is_keyframe(self, pose: SE3) -> bool:
        last = self.keyframes.last_pose
        if last is None:
            return True
        moved = float(np.linalg.norm(pose.translation - last.translation))
        cosine = (np.trace(last.rotation.T @ pose.rotation) - 1.0) / 2.0
        turned_deg = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
        return (
            moved >= self.config.keyframe_translation_m - 1e-6
            or turned_deg >= self.config.keyframe_rotation_deg - 1e-6
        )

    def _floating(self) -> Bool[ndarray, " size"]:
        """Gaussians whose voxel, and all of its 26 neighbours, have been seen without a surface."""
        states = self.voxels.states
        indices, inside = self.voxels.index_of(self.gaussians.centres_m.astype(np.float64))
        floating = np.zeros(self.gaussians.size, bool)
        if states.size == 0 or not inside.any():
            return floating
        surface = states == VoxelState.OCCUPIED
        near_surface = _dilated(surface)
        i, j, k = indices[inside].T
        floating[inside] = (states[i, j, k] == VoxelState.FREE) & ~near_surface[i, j, k]
        return floating


def _dilated(mask: Bool[ndarray, "nx ny nz"]) -> Bool[ndarray, "nx ny nz"]:
    grown = mask.copy()
    for axis in range(3):
        source = grown.copy()
        low: list[slice] = [slice(None)] * 3
        high: list[slice] = [slice(None)] * 3
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        grown[tuple(low)] |= source[tuple(high)]
        grown[tuple(high)] |= source[tuple(low)]
    return grown


def _predicted_psnr(image: TrainingImage, rendered: RenderedView) -> float:
    covered: Bool[ndarray, "h w"] = (rendered.silhouette > 0.9) & (image.depth_m > 0)
    if covered.sum() < 1000:
        return float("nan")
    difference: Float[ndarray, "n 3"] = rendered.colour[covered] - image.rgb[covered] / np.float32(255.0)
    return float(-10.0 * np.log10(max(float(np.mean(np.square(difference))), 1e-10)))

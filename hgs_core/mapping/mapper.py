"""The mapper: the only writer of the maps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32, Int32
from numpy import ndarray

from hgs_core.errors import MapError
from hgs_core.gaussians.gaussian_map import BLOCK, LOGIT_OPACITY, GaussianMap
from hgs_core.gaussians.information import accumulate_information
from hgs_core.gaussians.render import render
from hgs_core.gaussians.rendered_view import RenderedView
from hgs_core.geometry.boxes import Box
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.accrued_steps import AccruedSteps
from hgs_core.mapping.config import MappingConfig
from hgs_core.mapping.density import SurfaceDensity
from hgs_core.mapping.depth_filter import training_image
from hgs_core.mapping.insertion import missing_pixels, new_gaussians, wanted_spacing
from hgs_core.mapping.keyframe_archive import KeyframeArchive
from hgs_core.mapping.keyframes import KeyframeStore, TrainingImage, halved_camera
from hgs_core.mapping.pose_correction import CorrectionReport, motions_of, rebuilt_voxels
from hgs_core.mapping.redundancy import foretold_psnr, is_near, moved_and_turned, predicted_psnr
from hgs_core.mapping.replay import Replay
from hgs_core.mapping.scan_log import ScanLog
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.native import kernels
from hgs_core.sensing.frame import Frame, Scan
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap

_RETIRED_LOGIT = -20.0
_COMPACT_SHARE = 0.02
_PIXELS_HALVED = 4.0
"""Of the camera, that one of the halved image stands for."""


@dataclass(frozen=True, kw_only=True)
class IntegrationReport:
    """What one frame did to the map."""

    inserted: int
    retired: int
    """Coarse Gaussians replaced by finer ones."""
    keyframe: bool
    thinned: bool
    """The frame showed nothing new and went into the voxels alone."""
    psnr_predicted_db: float
    """Of the frame against the map *before* it was learnt, over pixels the map covered; NaN if too few."""


class Mapper:
    """Turns frames and scans into a voxel map and a Gaussian map, with bounded work for each.

    `integrate` a frame: integrate voxels; halve and smooth; average depth into the centres in view; replace
    what is too coarse; add what is missing; now and then prune. Then `optimise` some steps on this frame and
    on keyframes. Work follows what the camera sees, not the size of the map.
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
        correctable: bool = False,
    ) -> None:
        """`correctable`: keep what `correct_poses` needs of the scans, 6 kB each."""
        self.config = config
        self.gaussians = GaussianMap(primitive=config.primitive)
        self.voxels = VoxelMap(voxel_config, region=region)
        self.keyframes = KeyframeStore(keyframe_folder, range_m=camera_range_m)
        self._scans = ScanLog() if correctable else None
        self._camera_range_m = camera_range_m
        self._scanner_range_m = scanner_range_m
        self._rng = rng
        self._replay = Replay(config, rng)
        self._density = SurfaceDensity(max_per_m2=config.max_gaussians_per_m2)
        self._steps = AccruedSteps(config.iterations_per_s, at_most_s=config.iterations_accrue_s)
        self._newest: TrainingImage | None = None
        self._learn_newest = True
        self._learnt_pose: SE3 | None = None
        self._n_frames = 0
        self._timestamp_s = 0.0

    def integrate_scan(self, scan: Scan) -> None:
        self.voxels.integrate_scan(scan, range_m=self._scanner_range_m)
        if self._scans is not None:
            # Before the first keyframe there is none yet: it will be the next frame.
            self._scans.add(scan, anchor_keyframe=max(len(self.keyframes) - 1, 0))
        self._timestamp_s = scan.timestamp_s

    def integrate(self, frame: Frame, *, may_thin: bool = False) -> IntegrationReport:
        """Take one frame in. With `may_thin`, a frame that shows nothing new (`ThinningConfig`) goes into the
        voxels alone.
        """
        self.voxels.integrate_frame(frame, range_m=self._camera_range_m)
        self._steps.earn(frame.timestamp_s)
        self._timestamp_s = frame.timestamp_s
        image = training_image(frame, self.config.fusion)
        self._newest = image
        if may_thin and is_near(frame.T_world_camera, self._learnt_pose, self.config.thinning):
            foretold = foretold_psnr(self.gaussians, image, self.config.insertion, self.config.thinning)
            if foretold is not None:
                self._learn_newest = False
                return IntegrationReport(
                    inserted=0, retired=0, keyframe=False, thinned=True, psnr_predicted_db=foretold
                )
        self._learn_newest = True
        self._learnt_pose = frame.T_world_camera
        return self._learn(frame, image)

    def optimise(
        self, *, interrupted: Callable[[], bool], time_left: Callable[[], bool] | None = None
    ) -> int:
        """Optimisation steps on the newest frame and on keyframes; returns how many.

        As many as mission time has earned (`MappingConfig.iterations_per_s`), or, where it is given, as long
        as `time_left` holds, but one at least: who is always late would else never learn. Both are asked
        before every step, and `interrupted` ends the steps early.
        """
        if self._newest is None:
            return 0
        pays = self._steps.spend if time_left is None else _at_least_once(time_left)
        return self._replay.optimise(
            self.gaussians,
            self.keyframes,
            self._newest,
            learn_image=self._learn_newest,
            range_m=self._camera_range_m,
            may_step=lambda: not interrupted() and pays(),
        )

    def snapshot(self) -> MapSnapshot:
        return MapSnapshot(
            gaussians=self.gaussians,
            voxels=self.voxels,
            version=self.gaussians.version + self.voxels.version,
            timestamp_s=self._timestamp_s,
        )

    def prune(self, *, compact_share: float = 0.0) -> int:
        """Drop faint Gaussians, and those that float: whose voxel has been seen free and none of its 26
        neighbours occupied. Returns how many.

        Below `compact_share` of the map they are only made invisible, and dropped in a later call: that moves
        the rows behind them, which is work in proportion to the map.
        """
        kept = np.empty(self.gaussians.size, bool)
        kernels.flag_worth_keeping(
            self.gaussians.parameters[: self.gaussians.size],
            _logit(self.config.prune_opacity),
            self.voxels.states,
            tuple(self.voxels.origin_index.tolist()),
            self.voxels.config.size_m,
            kept,
        )
        dropped = int(len(kept) - np.count_nonzero(kept))
        if dropped > compact_share * len(kept):
            self.gaussians.keep(kept)
            return dropped
        self.gaussians.parameters[: len(kept)][~kept, LOGIT_OPACITY] = _RETIRED_LOGIT
        self.gaussians.version += 1
        self.gaussians.refresh_blocks()
        return 0

    def correct_poses(self, corrected: Mapping[int, SE3]) -> CorrectionReport:
        """Put keyframes at other poses (`T_world_camera` by index), as a loop closure or a better
        localisation finds them. Gaussians, scans and the frames since move rigidly with their keyframes;
        voxels are built anew. To be called between two frames.

        Raises `MapError` for a keyframe that there is not, for a map that another run began, and where the
        mapper was not made `correctable`.
        """
        if self._scans is None:
            raise MapError("the mapper was not made correctable: its scans were not kept to move along")
        motions = motions_of(corrected, self.keyframes)
        observed_before = self.voxels.n_observed
        moved = self.gaussians.move_with_keyframes(motions)
        self.keyframes.correct(corrected)
        self._scans.move(motions)
        newest = motions.get(len(self.keyframes) - 1)
        if newest is not None and self._learnt_pose is not None:
            self._learnt_pose = newest @ self._learnt_pose
        if newest is not None and self._newest is not None:
            self._newest = replace(self._newest, T_world_camera=newest @ self._newest.T_world_camera)
        self.voxels = rebuilt_voxels(
            self.voxels,
            self.keyframes,
            self._scans,
            camera_range_m=self._camera_range_m,
            scanner_range_m=self._scanner_range_m,
        )
        self._recount()
        return CorrectionReport(
            keyframes=len(motions),
            gaussians=moved,
            observed_before=observed_before,
            observed_after=self.voxels.n_observed,
        )

    def begin_with(
        self, gaussians: GaussianMap, voxels: VoxelMap, keyframes: KeyframeArchive, *, seen_from: SE3
    ) -> None:
        """Go on from the maps and keyframes of another run, of the same primitive, voxels and camera, that
        has integrated frames from `seen_from` (batched poses).

        Its Gaussians count as settled: their centres are averaged of as much as ever counts, and their
        information is that of those frames. Keyframes lie before time 0.
        """
        size, camera = gaussians.size, keyframes.intrinsics
        gaussians.n_depth_observations[:size] = self.config.fusion.max_observations
        far_m = self._camera_range_m + kernels.BEHIND_M
        for k in range(len(seen_from.translation)):
            pose = seen_from[k]
            accumulate_information(
                gaussians, halved_camera(camera), pose, far_m=far_m, pixel_weight=_PIXELS_HALVED
            )
        self.gaussians, self.voxels = gaussians, voxels
        last_s = float(np.max(keyframes.timestamps_s))
        for index in range(len(keyframes)):
            colour, depth = keyframes.files(index)
            self.keyframes.inherit(
                keyframes.load_halved(index),
                camera,
                colour=colour,
                depth=depth,
                timestamp_s=float(keyframes.timestamps_s[index]) - last_s - 1.0,
            )
        self._recount()

    def state(self) -> dict[str, Any]:
        """Everything that later frames depend on; to be taken between two frames, after `optimise`."""
        return {
            "gaussians": self.gaussians.state(),
            "voxels": self.voxels.state(),
            "keyframes": self.keyframes.state(),
            "scans": None if self._scans is None else self._scans.state(),
            "density": self._density.state(),
            "steps": self._steps.state(),
            "learnt_pose": None if self._learnt_pose is None else self._learnt_pose.as_matrix(),
            "rng": self._rng.bit_generator.state,
            "n_frames": self._n_frames,
            "timestamp_s": self._timestamp_s,
        }

    def restore(self, state: dict[str, Any], *, keyframe_folder: Path) -> None:
        self.gaussians = GaussianMap.restore(state["gaussians"])
        self.voxels = VoxelMap.restore(state["voxels"])
        self.keyframes = KeyframeStore.restore(keyframe_folder, state["keyframes"])
        self._scans = None if state["scans"] is None else ScanLog.restore(state["scans"])
        self._density.restore(state["density"])
        self._steps.restore(state["steps"])
        learnt = state["learnt_pose"]
        self._learnt_pose = None if learnt is None else SE3.from_matrix(learnt)
        self._newest = None
        self._rng.bit_generator.state = state["rng"]
        self._n_frames = state["n_frames"]
        self._timestamp_s = state["timestamp_s"]

    def _learn(self, frame: Frame, image: TrainingImage) -> IntegrationReport:
        spacing_m = wanted_spacing(image, self.config.insertion)
        retired = self._fuse_depth(image, spacing_m)
        # What lies behind the farthest surface in view is hidden, and the larger the map, the more of it.
        far_m = image.farthest_m + kernels.BEHIND_M
        pose, surface_m = image.T_world_camera, image.depth_m
        rendered = render(self.gaussians, image.intrinsics, pose, far_m=far_m, surface_m=surface_m)
        psnr = predicted_psnr(image, rendered)
        is_keyframe = self._is_keyframe(frame.T_world_camera)
        inserted = self._insert(image, rendered, spacing_m, anchor=len(self.keyframes) - (not is_keyframe))
        accumulate_information(
            self.gaussians,
            image.intrinsics,
            pose,
            far_m=far_m,
            surface_m=surface_m,
            pixel_weight=_PIXELS_HALVED,
        )
        if is_keyframe:
            self.keyframes.add(image, frame)
        self._n_frames += 1
        if self._n_frames % self.config.prune_interval == 0:
            self.prune(compact_share=_COMPACT_SHARE)
            self._recount()
        return IntegrationReport(
            inserted=inserted, retired=retired, keyframe=is_keyframe, thinned=False, psnr_predicted_db=psnr
        )

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
        config = self.config
        new = new_gaussians(
            image, wanted, np.float32(coarsening) * spacing_m, config.insertion, config.primitive
        )
        room = config.max_gaussians - self.gaussians.size
        new = new.chosen(self._density.admit(new.parameters)).chosen(slice(room))
        self.gaussians.append(new.parameters, new.normals, anchor_keyframe=anchor)
        return len(new)

    def _coarsening(self) -> int | None:
        """How much coarser than usual to insert as the budget runs out; None when it is spent."""
        used = self.gaussians.size / self.config.max_gaussians
        if used >= 1.0:
            return None
        if used > 0.95:
            return 4
        return 2 if used > 0.85 else 1

    def _recount(self) -> None:
        """Count the Gaussians of each voxel anew."""
        self._density.recount(
            self.gaussians.parameters[: self.gaussians.size],
            self.voxels,
            min_logit_opacity=_logit(self.config.prune_opacity),
        )

    def _is_keyframe(self, pose: SE3) -> bool:
        last = self.keyframes.last_pose
        if last is None:
            return True
        moved_m, turned_deg = moved_and_turned(pose, last)
        return (
            moved_m >= self.config.keyframe_translation_m - 1e-6
            or turned_deg >= self.config.keyframe_rotation_deg - 1e-6
        )


def _logit(opacity: float) -> float:
    return float(np.log(opacity / (1.0 - opacity)))


def _at_least_once(time_left: Callable[[], bool]) -> Callable[[], bool]:
    """True when asked first, then as `time_left` says."""
    first = iter([True])
    return lambda: next(first, False) or time_left()

"""One map against its scene: every figure of the protocol."""

from __future__ import annotations

import time
from collections.abc import Callable

from jaxtyping import Float32
from numpy import ndarray

from hgs_core.evaluation.ceiling import CeilingRequest, observable_ceiling
from hgs_core.evaluation.compatibility import activegamer_metrics, naruto_metrics
from hgs_core.evaluation.held_out import held_out_poses, image_metrics
from hgs_core.evaluation.result import EvaluationResult
from hgs_core.evaluation.surface import OPAQUE, SurfaceMetrics, surface_metrics
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.volume_fusion import SurfaceMesh
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.scene import Scene


def evaluate_mission(
    *,
    scene: Scene,
    caster: RayCaster,
    start_xy: tuple[float, float],
    gaussians: GaussianMap,
    mesh: SurfaceMesh | None,
    training_poses: SE3,
    intrinsics: CameraIntrinsics,
    camera_height_m: float,
    range_m: float,
    robot_radius_m: float,
    robot_height_m: float,
    progress: Callable[[str], None] | None = None,
) -> EvaluationResult:
    """Compare a finished map (and the `mesh` fused beside it) with the scene's true surface and views.

    `training_poses` is the batch of `T_world_camera` of the integrated frames; `caster` casts against
    `scene.mesh`. Deterministic, and nothing of it reaches a planner. Raises `SceneError` when the start is
    not free.
    """
    began = time.perf_counter()

    def report(message: str) -> None:
        if progress is not None:
            progress(message)

    report(f"observable surface of {scene.name}")
    ceiling = observable_ceiling(
        caster,
        CeilingRequest(
            start_xy=start_xy,
            robot_radius_m=robot_radius_m,
            robot_height_m=robot_height_m,
            camera_height_m=camera_height_m,
            intrinsics=intrinsics,
            range_m=range_m,
        ),
        progress=progress,
    )
    report("surface metrics")
    centres = gaussians.centres_m

    def measured(points: Float32[ndarray, "n 3"]) -> SurfaceMetrics:
        return surface_metrics(
            points,
            samples=ceiling.samples_m,
            observable=ceiling.observable,
            distance_to_surface=caster.distance_to_surface,
        )

    images = image_metrics(
        caster,
        gaussians,
        poses=held_out_poses(ceiling.positions_m, camera_height_m=camera_height_m),
        training_poses=training_poses,
        intrinsics=intrinsics,
        range_m=range_m,
        progress=progress,
    )
    surface = measured(centres)
    return EvaluationResult(
        surface=surface,
        surface_opaque=measured(centres[gaussians.opacities >= OPAQUE]),
        surface_mesh=None if mesh is None else measured(mesh.vertices_m),
        naruto=naruto_metrics(surface),
        activegamer=activegamer_metrics(centres, ceiling.samples_m),
        observable_fraction=ceiling.fraction,
        n_reachable=len(ceiling.positions_m),
        images=images,
        wall_s=time.perf_counter() - began,
    )

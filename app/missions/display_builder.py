"""Makes a `DisplayView` from a `MissionView`: in the mission process, between two frames, so quickly."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Float32, UInt8
from numpy import ndarray
from PIL import Image

from app.missions.display import (
    CANDIDATE_STATUSES,
    MAX_CANDIDATES,
    MAX_POLYLINE,
    MAX_SUBSPACES,
    MAX_TRAJECTORY,
    SUBSPACE_STATES,
    DisplayView,
)
from app.missions.display_layers import (
    areas_of,
    panorama_image,
    shown_roadmap,
    shown_voxels,
    splat_quality,
)
from hgs_core.evaluation.colour_maps import colourise_depth, colourise_log
from hgs_core.gain.viewpoint import GainConfig
from hgs_core.gaussians.gaussian_map import CENTRE, LOG_RADIUS, LOGIT_OPACITY, RGB, GaussianMap
from hgs_core.gaussians.information import quality_image
from hgs_core.mission.events import MissionView
from hgs_core.planning.plan import Candidate, Subspace

GAP_FACTOR = 1.5
"""How much wider than evenly spaced ones splats of a thinned-out map are drawn."""
QUALITY_WIDTH = 300
"""Width of the quality-gain image [px]."""


def display_view(view: MissionView, *, max_splats: int, max_image_width: int) -> DisplayView:
    """Everything a viewer draws of `view`, bounded in size; the arrays share nothing with the mission's."""
    centres, rgb, radii, normals, opacities = _splats(view.snapshot.gaussians, max_splats)
    plan = view.plan
    voxel_centres, voxel_kinds, voxel_size_m = shown_voxels(
        view.snapshot.voxels, np.array([view.robot.x_m, view.robot.y_m])
    )
    insight = view.insight
    panorama = insight.panorama if insight is not None else None
    at = insight.view_m if insight is not None and panorama is not None else None
    region, no_go, no_go_sizes = areas_of(view.directives)
    subspaces = plan.subspaces[:MAX_SUBSPACES] if plan is not None else ()
    candidates = _best(plan.candidates) if plan is not None else ()
    frame = view.frame
    return DisplayView(
        time_s=view.time_s,
        n_gaussians=view.snapshot.gaussians.size,
        splat_centres_m=centres,
        splat_rgb=rgb,
        splat_radii_m=radii,
        splat_normals=normals,
        splat_opacities=opacities,
        splat_quality=splat_quality(
            view.snapshot.gaussians,
            _stride(view.snapshot.gaussians, max_splats),
            GainConfig().prior_information,
        ),
        voxel_centres_m=voxel_centres,
        voxel_kinds=voxel_kinds,
        voxel_size_m=np.array([voxel_size_m], np.float32),
        roadmap_m=shown_roadmap(insight.roadmap_m if insight is not None else np.zeros((0, 2, 2))),
        panorama_m=np.zeros((0, 3), np.float32) if at is None else at[None].astype(np.float32),
        panorama=panorama_image(panorama),
        region_m=region,
        no_go_m=no_go,
        no_go_sizes=no_go_sizes,
        trajectory_m=_thinned(view.trajectory_m, MAX_TRAJECTORY),
        subspace_bounds_m=_rows([(*space.lower_m, *space.upper_m) for space in subspaces], 6),
        subspace_states=_indices(subspaces),
        candidate_poses=_rows([(c.x_m, c.y_m, c.z_m, c.yaw_rad) for c in candidates], 4),
        candidate_gains=_rows([(c.coverage_gain, c.quality_gain, c.total_gain) for c in candidates], 3),
        candidate_statuses=np.array([CANDIDATE_STATUSES.index(c.status) for c in candidates], np.uint8),
        global_tour_m=_thinned(plan.global_tour_m, MAX_POLYLINE) if plan is not None else _rows([], 3),
        local_path_m=_thinned(plan.local_path_m, MAX_POLYLINE) if plan is not None else _rows([], 3),
        T_world_camera=frame.T_world_camera.as_matrix().astype(np.float64),
        camera=np.array(
            [frame.intrinsics.width, frame.intrinsics.height, frame.intrinsics.fx, frame.intrinsics.fy]
        ),
        observed=_shrunk(frame.rgb, min(max_image_width, math.ceil(frame.rgb.shape[1] / 2))),
        rendered=_shrunk(view.rendered_rgb, max_image_width),
        depth=colourise_depth(_every(frame.depth_m, min(max_image_width, math.ceil(frame.rgb.shape[1] / 2)))),
        quality=_quality(view),
    )


def _splats(
    gaussians: GaussianMap, limit: int
) -> tuple[
    Float32[ndarray, "n 3"],
    UInt8[ndarray, "n 3"],
    Float32[ndarray, " n"],
    Float32[ndarray, "n n_normal"],
    UInt8[ndarray, " n"],
]:
    """Centres, colours, radii, normals and opacities of at most `limit` Gaussians: every k-th, larger and
    more opaque by what it stands for.

    Its radius grows by sqrt(k), as the spacing does, and by `GAP_FACTOR`, as thinned-out Gaussians are spread
    less evenly; its opacity becomes that of k of them behind each other: surfaces stay closed. A stride keeps
    the choice the same from view to view, as rows keep their order.
    """
    stride = _stride(gaussians, limit)
    growth = 1.0 if stride == 1 else GAP_FACTOR * math.sqrt(stride)
    parameters = gaussians.parameters[: gaussians.size : stride]
    transparency = 1.0 / (1.0 + np.exp(parameters[:, LOGIT_OPACITY]))
    opacities = 255.0 * (1.0 - transparency**stride)
    return (
        parameters[:, CENTRE].astype(np.float32),
        (np.clip(parameters[:, RGB], 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8),
        (np.exp(parameters[:, LOG_RADIUS]) * growth).astype(np.float32),
        gaussians.normals[: gaussians.size : stride].copy(),
        opacities.astype(np.uint8),
    )


def _stride(gaussians: GaussianMap, limit: int) -> int:
    return max(1, math.ceil(gaussians.size / limit))


def _quality(view: MissionView) -> UInt8[ndarray, "h w 3"]:
    camera = view.frame.intrinsics
    image = quality_image(
        view.snapshot.gaussians,
        camera.scaled(min(1.0, QUALITY_WIDTH / camera.width)),
        view.frame.T_world_camera,
        GainConfig().prior_information,
    )
    return colourise_log(np.asarray(image, np.float32))


def _best(candidates: tuple[Candidate, ...]) -> tuple[Candidate, ...]:
    """The `MAX_CANDIDATES` with the highest gain, the selected ones first."""
    ranked = sorted(candidates, key=lambda c: (c.status != "selected", -c.total_gain))
    return tuple(ranked[:MAX_CANDIDATES])


def _indices(subspaces: tuple[Subspace, ...]) -> UInt8[ndarray, " n"]:
    return np.array([SUBSPACE_STATES.index(space.state) for space in subspaces], np.uint8)


def _rows(rows: list[tuple[float, ...]], width: int) -> Float32[ndarray, "n width"]:
    return np.array(rows, np.float32).reshape(len(rows), width)


def _thinned(points: Float[ndarray, "n 3"], limit: int) -> Float32[ndarray, "n_kept 3"]:
    """At most `limit` of the points, evenly spread, the first and the last kept."""
    if len(points) <= limit:
        return np.array(points, np.float32)
    return np.asarray(points, np.float32)[np.linspace(0, len(points) - 1, limit).round().astype(int)]


def _shrunk(image: UInt8[ndarray, "h w 3"], width: int) -> UInt8[ndarray, "h2 w2 3"]:
    if image.shape[1] <= width:
        return np.array(image)
    height = max(1, round(image.shape[0] * width / image.shape[1]))
    return np.asarray(Image.fromarray(image).resize((width, height), Image.Resampling.BOX))


def _every(depth_m: Float32[ndarray, "h w"], width: int) -> Float32[ndarray, "h2 w2"]:
    """Every k-th pixel: averaging would mix near and far."""
    step = max(1, math.ceil(depth_m.shape[1] / width))
    return depth_m[::step, ::step]

"""`DisplayView`: what the service knows of a mission's maps and plan at one moment, ready to be drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
from jaxtyping import Float32, Float64, UInt8
from numpy import ndarray

DISPLAY_SCHEMA_VERSION: Final = 3

SUBSPACE_STATES: Final = ("reconstructed", "reconstructing", "unreconstructed")
CANDIDATE_STATUSES: Final = ("selected", "below_threshold", "unreachable", "crossing", "outranked")
VOXEL_KINDS: Final = ("occupied", "frontier", "missing")
"""A surface; free space beside something missing; what is missing."""
QUALITY_DECADES: Final = 3.0
IMAGE_KINDS: Final = ("observed", "rendered", "depth", "quality")


@dataclass(frozen=True, kw_only=True, eq=False)
class DisplayView:
    """Plain arrays in the world frame [m], sized for a viewer, not for computing."""

    time_s: float
    n_gaussians: int
    """In the map; the splats below are at most a stated number of them."""
    splat_centres_m: Float32[ndarray, "n 3"]
    splat_rgb: UInt8[ndarray, "n 3"]
    splat_radii_m: Float32[ndarray, " n"]
    splat_normals: Float32[ndarray, "n n_normal"]
    """Of discs (n, 3); of isotropic splats (n, 0)."""
    splat_opacities: UInt8[ndarray, " n"]
    """0..255."""
    splat_quality: UInt8[ndarray, " n"]
    """How little is known of each splat's colour: 0 (known well) to 255, over `QUALITY_DECADES`."""
    voxel_centres_m: Float32[ndarray, "n_voxels 3"]
    voxel_kinds: UInt8[ndarray, " n_voxels"]
    """Index into `VOXEL_KINDS`."""
    voxel_size_m: Float32[ndarray, " 1"]
    """Edge of a voxel as shown: of a thinned-out map larger than it is."""
    roadmap_m: Float32[ndarray, "n_edges 2 2"]
    """Both ends of each edge of the roadmap that can be driven."""
    panorama_m: Float32[ndarray, "n_panoramas 3"]
    """Where the panorama is taken: the next view; none when there is none (n_panoramas is 0 or 1)."""
    panorama: UInt8[ndarray, "hp wp 3"]
    """What would be gained there in each direction, coverage above quality, coloured; azimuths from behind
    (-180 degrees) over ahead along +x to behind."""
    region_m: Float32[ndarray, "n_region 2"]
    """Corners of the region of interest; none without one."""
    no_go_m: Float32[ndarray, "n_no_go 2"]
    """Corners of all no-go areas, one after another."""
    no_go_sizes: UInt8[ndarray, " n_areas"]
    """How many corners each of them has."""
    trajectory_m: Float32[ndarray, "n_poses 3"]
    subspace_bounds_m: Float32[ndarray, "n_subspaces 6"]
    """Lower corner, upper corner."""
    subspace_states: UInt8[ndarray, " n_subspaces"]
    """Index into `SUBSPACE_STATES`."""
    candidate_poses: Float32[ndarray, "n_candidates 4"]
    """x, y, z [m], yaw [rad]."""
    candidate_gains: Float32[ndarray, "n_candidates 3"]
    """Coverage, quality, total."""
    candidate_statuses: UInt8[ndarray, " n_candidates"]
    """Index into `CANDIDATE_STATUSES`."""
    global_tour_m: Float32[ndarray, "n_tour 3"]
    local_path_m: Float32[ndarray, "n_local 3"]
    T_world_camera: Float64[ndarray, "4 4"]
    camera: Float64[ndarray, " 4"]
    """Width and height [px], fx and fy [px]."""
    observed: UInt8[ndarray, "h w 3"]
    rendered: UInt8[ndarray, "h2 w2 3"]
    depth: UInt8[ndarray, "h3 w3 3"]
    """Measured depth, coloured."""
    quality: UInt8[ndarray, "h4 w4 3"]
    """Quality gain of every pixel of the current view, coloured on a logarithmic scale."""

    def arrays(self) -> dict[str, ndarray]:
        return {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if field.name not in ("time_s", "n_gaussians")
        }

    def meta(self) -> dict[str, Any]:
        return {"schema": DISPLAY_SCHEMA_VERSION, "time_s": self.time_s, "n_gaussians": self.n_gaussians}

    @staticmethod
    def of(arrays: Mapping[str, ndarray], meta: Mapping[str, Any]) -> DisplayView:
        """From what `arrays` and `meta` gave; views that an earlier version kept lack some layers."""
        known = {**arrays} if meta["schema"] >= DISPLAY_SCHEMA_VERSION else {**_without_layers(arrays)}
        return DisplayView(time_s=meta["time_s"], n_gaussians=meta["n_gaussians"], **known)

    @property
    def robot_m(self) -> Float32[ndarray, " 3"]:
        """Where the camera is, on the floor."""
        return np.array([self.T_world_camera[0, 3], self.T_world_camera[1, 3], 0.0], np.float32)


MAX_TRAJECTORY: Final = 4_000
MAX_SUBSPACES: Final = 1_000
MAX_CANDIDATES: Final = 400
MAX_POLYLINE: Final = 1_000
MAX_VOXELS: Final = 12_000
VOXEL_REACH_M: Final = 12.0
"""Voxels are shown in a square of this half-width about the robot: looking at them costs time."""
MAX_EDGES: Final = 3_000
MAX_AREA_CORNERS: Final = 33 * 64
PANORAMA_PX: Final = (88, 240)
"""Height and width of the panorama."""


def _without_layers(arrays: Mapping[str, ndarray]) -> dict[str, ndarray]:
    """A view of schema 2, with nothing in the layers that came later."""
    return {
        "splat_quality": np.zeros(len(arrays["splat_centres_m"]), np.uint8),
        "voxel_centres_m": np.zeros((0, 3), np.float32),
        "voxel_kinds": np.zeros(0, np.uint8),
        "voxel_size_m": np.zeros(1, np.float32),
        "roadmap_m": np.zeros((0, 2, 2), np.float32),
        "panorama_m": np.zeros((0, 3), np.float32),
        "panorama": np.zeros((*PANORAMA_PX, 3), np.uint8),
        "region_m": np.zeros((0, 2), np.float32),
        "no_go_m": np.zeros((0, 2), np.float32),
        "no_go_sizes": np.zeros(0, np.uint8),
        **arrays,
    }


def slot_bytes(max_splats: int, max_image_width: int) -> int:
    """Upper bound of a view's size in an `ArraySlot`: images are at most twice as high as wide."""
    splats = max_splats * (12 + 3 + 4 + 12 + 1 + 1)
    layers = MAX_VOXELS * 13 + MAX_EDGES * 16 + MAX_AREA_CORNERS * 9 + 3 * PANORAMA_PX[0] * PANORAMA_PX[1]
    images = 4 * max_image_width * (2 * max_image_width) * 3
    lists = MAX_TRAJECTORY * 12 + MAX_SUBSPACES * 25 + MAX_CANDIDATES * 29 + 2 * MAX_POLYLINE * 12
    return splats + images + lists + layers + 64 * 1024

"""Layers of a `DisplayView` that are worked out from maps and plan: voxels, quality, panorama, areas."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Float32, UInt8
from numpy import ndarray
from PIL import Image

from app.missions.display import MAX_EDGES, MAX_VOXELS, PANORAMA_PX, QUALITY_DECADES, VOXEL_REACH_M
from hgs_core.evaluation.colour_maps import colourise
from hgs_core.gain.viewpoint import GainPanorama
from hgs_core.gaussians.gaussian_map import RGB, GaussianMap
from hgs_core.planning.directives import Directives
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState

_GAP_PX: Final = 4


def splat_quality(gaussians: GaussianMap, stride: int, prior_information: float) -> UInt8[ndarray, " n"]:
    """The posterior variance of every `stride`-th Gaussian's colour, `1 / (H_train + prior)`, against that of
    one never seen, on a logarithmic scale of `QUALITY_DECADES`: 255 for nothing known."""
    information = gaussians.information[: gaussians.size : stride, RGB].mean(axis=1, dtype=np.float64)
    share = prior_information / (information + prior_information)
    return (255.0 * np.clip(1.0 + np.log10(share) / QUALITY_DECADES, 0.0, 1.0) + 0.5).astype(np.uint8)


def shown_voxels(
    voxels: VoxelMap, robot_xy_m: Float[ndarray, " 2"]
) -> tuple[Float32[ndarray, "n 3"], UInt8[ndarray, " n"], float]:
    """Centres, kinds (`VOXEL_KINDS`) and shown edge of at most `MAX_VOXELS` voxels near the robot: of more,
    evenly spread ones, drawn larger."""
    size = voxels.config.size_m
    if not voxels.states.size:
        return np.zeros((0, 3), np.float32), np.zeros(0, np.uint8), size
    lower = np.asarray(voxels.lower_m(), np.float64)
    first = np.clip(
        np.floor((robot_xy_m - VOXEL_REACH_M - lower[:2]) / size).astype(int), 0, voxels.states.shape[:2]
    )
    last = np.clip(
        np.ceil((robot_xy_m + VOXEL_REACH_M - lower[:2]) / size).astype(int), first, voxels.states.shape[:2]
    )
    here = (slice(first[0], last[0]), slice(first[1], last[1]))
    states, missing = voxels.states[here], voxels.missing()[here]
    free = states == VoxelState.FREE
    surface = (states == VoxelState.OCCUPIED) & _beside(free)
    frontier = free & _beside(missing)
    found = [np.argwhere(mask) for mask in (surface, frontier, missing)]
    stride = max(1, math.ceil(sum(map(len, found)) / MAX_VOXELS))
    kept = [index[::stride] for index in found]
    index = np.concatenate(kept)[:MAX_VOXELS]
    kinds = np.repeat(np.arange(3, dtype=np.uint8), [len(k) for k in kept])[:MAX_VOXELS]
    index = index + np.array([first[0], first[1], 0])
    return voxels.centres_m(index).astype(np.float32), kinds, size * stride ** (1 / 3)


def shown_roadmap(edges_m: Float[ndarray, "n 2 2"]) -> Float32[ndarray, "m 2 2"]:
    """Every k-th edge, at most `MAX_EDGES`."""
    stride = max(1, math.ceil(len(edges_m) / MAX_EDGES))
    return edges_m[::stride].astype(np.float32)


def panorama_image(panorama: GainPanorama | None) -> UInt8[ndarray, "h w 3"]:
    """Coverage above, quality below, each scaled to its own greatest value; black without a panorama."""
    height, width = PANORAMA_PX
    image = np.zeros((height, width, 3), np.uint8)
    if panorama is not None:
        half = (height - _GAP_PX) // 2
        image[:half] = _strip(panorama.coverage, half, width)
        image[height - half :] = _strip(panorama.quality, half, width)
    return image


def areas_of(
    directives: Directives,
) -> tuple[Float32[ndarray, "n 2"], Float32[ndarray, "m 2"], UInt8[ndarray, " k"]]:
    """Corners of the region, of all no-go areas, and how many each of these has."""
    region = np.zeros((0, 2)) if directives.region_m is None else directives.region_m
    no_go = np.concatenate([np.zeros((0, 2)), *directives.no_go_m])
    sizes = np.array([len(area) for area in directives.no_go_m], np.uint8)
    return region.astype(np.float32), no_go.astype(np.float32), sizes


def _strip(values: Float32[ndarray, "n_rows n_azimuths"], height: int, width: int) -> UInt8[ndarray, "h w 3"]:
    """Rows go up in `values` and down in the image; azimuths turn left, which is left in the image, too."""
    top = float(values.max(initial=0.0))
    shares = np.sqrt(values / top) if top > 0 else np.zeros_like(values)
    image = Image.fromarray(np.ascontiguousarray(colourise(shares)[::-1, ::-1]))
    return np.asarray(image.resize((width, height), Image.Resampling.BILINEAR))


def _beside(mask: Bool[ndarray, "nx ny nz"]) -> Bool[ndarray, "nx ny nz"]:
    """Voxels that share a face with one of the mask."""
    beside = np.zeros_like(mask)
    for axis in range(3):
        ahead, behind = [slice(None)] * 3, [slice(None)] * 3
        ahead[axis], behind[axis] = slice(1, None), slice(None, -1)
        beside[tuple(ahead)] |= mask[tuple(behind)]
        beside[tuple(behind)] |= mask[tuple(ahead)]
    return beside

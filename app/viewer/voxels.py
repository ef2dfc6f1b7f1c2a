"""Layer: the voxel map near the robot: surfaces, the frontier of what is known, and what is missing."""

from __future__ import annotations

from typing import Final

import numpy as np
import viser

from app.missions.display import MAX_VOXELS, VOXEL_KINDS, DisplayView
from app.viewer.palette import VOXEL, as_linear

_SHARE: Final = {"occupied": 0.9, "frontier": 0.45, "missing": 0.6}
"""Edge of a shown box, in voxels: free space is drawn small, so that one sees through it."""
_OPACITY: Final = {"occupied": 0.55, "frontier": 0.5, "missing": 0.9}
_CORNERS: Final = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32) - 0.5
_FACES: Final = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ],
    np.uint32,
)  # fmt: skip


class VoxelLayer:
    """One batched node of `MAX_VOXELS` boxes; those above `clip_height_m` are hidden."""

    title = "Voxels"
    shown_at_first = False

    def __init__(self, server: viser.ViserServer) -> None:
        self._visible = False
        self.clip_height_m = float("inf")
        nothing = np.zeros((MAX_VOXELS, 3), np.float32)
        self._node = server.scene.add_batched_meshes_simple(
            "/voxels",
            _CORNERS,
            _FACES,
            batched_wxyzs=np.tile(np.array([1, 0, 0, 0], np.float32), (MAX_VOXELS, 1)),
            batched_positions=nothing,
            batched_scales=nothing,
            batched_colors=nothing.astype(np.uint8),
            batched_opacities=nothing[:, 0],
            opacity=1.0,
            flat_shading=True,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

    def update(self, view: DisplayView) -> None:
        if not self._visible:
            return
        shown = view.voxel_centres_m[:, 2] <= self.clip_height_m
        centres, kinds = view.voxel_centres_m[shown][:MAX_VOXELS], view.voxel_kinds[shown][:MAX_VOXELS]
        n_boxes = len(centres)
        positions, scales = np.zeros((2, MAX_VOXELS, 3), np.float32)
        colours = np.zeros((MAX_VOXELS, 3), np.uint8)
        opacities = np.zeros(MAX_VOXELS, np.float32)
        edges = np.array([_SHARE[kind] for kind in VOXEL_KINDS], np.float32) * view.voxel_size_m[0]
        positions[:n_boxes] = centres
        scales[:n_boxes] = edges[kinds][:, None]
        colours[:n_boxes] = as_linear(np.array([VOXEL[kind] for kind in VOXEL_KINDS], np.uint8))[kinds]
        opacities[:n_boxes] = np.array([_OPACITY[kind] for kind in VOXEL_KINDS], np.float32)[kinds]
        self._node.batched_positions = positions
        self._node.batched_scales = scales
        self._node.batched_colors = colours
        self._node.batched_opacities = opacities

    def set_visible(self, visible: bool) -> None:
        self._visible = visible
        self._node.visible = visible

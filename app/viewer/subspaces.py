"""Layer: the cuboids of the global level, coloured by how far each is reconstructed."""

from __future__ import annotations

from typing import Final

import numpy as np
import viser
from jaxtyping import Float32, UInt8
from numpy import ndarray

from app.missions.display import MAX_SUBSPACES, SUBSPACE_STATES, DisplayView
from app.viewer.palette import SUBSPACE, as_linear

_CORNERS: Final = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
_FLOOR_EDGES: Final = np.array([[0, 2], [2, 6], [6, 4], [4, 0]])
_INSET_M: Final = 0.06
_LIFT_M: Final = 0.03
_FILL_OPACITY: Final = {"reconstructed": 0.10, "reconstructing": 0.30, "unreconstructed": 0.06}
_SLAB: Final = np.array([[x, y, 0.0] for x in (0, 1) for y in (0, 1)], np.float32)
_SLAB_FACES: Final = np.array([[0, 2, 1], [1, 2, 3]], np.uint32)


class SubspaceLayer:
    """Each cuboid as a tinted tile on the floor with an outline: boxes would hide the rooms in them."""

    title = "Subspaces"
    shown_at_first = True

    def __init__(self, server: viser.ViserServer) -> None:
        self._lines = server.scene.add_line_segments(
            "/subspaces/outlines",
            np.zeros((4 * MAX_SUBSPACES, 2, 3), np.float32),
            np.zeros((4 * MAX_SUBSPACES, 2, 3), np.uint8),
            thickness=2.0,
            thickness_units="screen",
        )
        nothing = np.zeros((MAX_SUBSPACES, 3), np.float32)
        self._tiles = server.scene.add_batched_meshes_simple(
            "/subspaces/tiles",
            _SLAB,
            _SLAB_FACES,
            batched_wxyzs=np.tile(np.array([1, 0, 0, 0], np.float32), (MAX_SUBSPACES, 1)),
            batched_positions=nothing,
            batched_scales=nothing,
            batched_colors=nothing.astype(np.uint8),
            batched_opacities=nothing[:, 0],
            opacity=1.0,
            side="double",
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )

    def update(self, view: DisplayView) -> None:
        self._show(view.subspace_bounds_m, view.subspace_states)

    def set_visible(self, visible: bool) -> None:
        self._lines.visible = visible
        self._tiles.visible = visible

    def _show(self, bounds: Float32[ndarray, "n 6"], states: UInt8[ndarray, " n"]) -> None:
        bounds, states = lowest_of_each_column(bounds, states)
        n_spaces = len(bounds)
        lower = bounds[:, :3] + np.array([_INSET_M, _INSET_M, _LIFT_M], np.float32)
        size = bounds[:, 3:] - bounds[:, :3] - np.array([2 * _INSET_M, 2 * _INSET_M, 0.0], np.float32)
        palette = as_linear(np.array([SUBSPACE[state] for state in SUBSPACE_STATES], np.uint8))
        colours = palette[states]
        corners = lower[:, None, :] + _CORNERS[None] * size[:, None, :]

        points = np.zeros((MAX_SUBSPACES, 4, 2, 3), np.float32)
        points[:n_spaces] = corners[:, _FLOOR_EDGES]
        tints = np.zeros((MAX_SUBSPACES, 4, 2, 3), np.uint8)
        tints[:n_spaces] = colours[:, None, None]
        self._lines.points = points.reshape(-1, 2, 3)
        self._lines.colors = tints.reshape(-1, 2, 3)

        positions = np.zeros((MAX_SUBSPACES, 3), np.float32)
        scales = np.zeros((MAX_SUBSPACES, 3), np.float32)
        fills = np.zeros((MAX_SUBSPACES, 3), np.uint8)
        opacities = np.zeros(MAX_SUBSPACES, np.float32)
        positions[:n_spaces], scales[:n_spaces], fills[:n_spaces] = lower, size, colours
        opacities[:n_spaces] = [_FILL_OPACITY[SUBSPACE_STATES[state]] for state in states]
        self._tiles.batched_positions = positions
        self._tiles.batched_scales = scales
        self._tiles.batched_colors = fills
        self._tiles.batched_opacities = opacities


def lowest_of_each_column(
    bounds: Float32[ndarray, "n 6"], states: UInt8[ndarray, " n"]
) -> tuple[Float32[ndarray, "m 6"], UInt8[ndarray, " m"]]:
    """One tile a column of cuboids, with the state that has most left to do: `reconstructing` before
    `unreconstructed` before `reconstructed`."""
    if len(bounds) == 0:
        return bounds, states
    urgency = np.array([0, 2, 1])[states]
    order = np.lexsort((bounds[:, 2], -urgency))
    columns = np.round(bounds[order][:, [0, 1, 3, 4]], 3)
    _, first = np.unique(columns, axis=0, return_index=True)
    chosen = bounds[order][first].copy()
    chosen[:, 2] = bounds[:, 2].min()
    return chosen, states[order][first]

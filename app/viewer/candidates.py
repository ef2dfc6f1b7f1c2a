"""Layer: the viewpoints that the planner considered; bigger and brighter = more to gain."""

from __future__ import annotations

from typing import Final

import numpy as np
import viser
from jaxtyping import Float32, UInt8
from numpy import ndarray

from app.missions.display import CANDIDATE_STATUSES, MAX_CANDIDATES, DisplayView
from app.viewer.palette import REJECTED, as_linear
from hgs_core.evaluation.colour_maps import ramp

_SMALL: Final = 0.55
_LARGE: Final = 1.6
_FAINT: Final = 0.35


class CandidateLayer:
    """One marker each: a ball with an arrow along the best yaw. Rejected ones are small and grey."""

    title = "Candidate views"
    shown_at_first = True

    def __init__(self, server: viser.ViserServer) -> None:
        vertices, faces = marker_mesh()
        zeros = np.zeros((MAX_CANDIDATES, 3), np.float32)
        self._node = server.scene.add_batched_meshes_simple(
            "/candidates",
            vertices,
            faces,
            batched_wxyzs=np.tile(np.array([1, 0, 0, 0], np.float32), (MAX_CANDIDATES, 1)),
            batched_positions=zeros,
            batched_scales=zeros,
            batched_colors=zeros.astype(np.uint8),
            batched_opacities=zeros[:, 0],
            opacity=1.0,
            flat_shading=True,
            side="double",
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )

    def update(self, view: DisplayView) -> None:
        self._show(view.candidate_poses, view.candidate_gains[:, 2], view.candidate_statuses)

    def set_visible(self, visible: bool) -> None:
        self._node.visible = visible

    def _show(
        self,
        poses: Float32[ndarray, "n 4"],
        totals: Float32[ndarray, " n"],
        statuses: UInt8[ndarray, " n"],
    ) -> None:
        n_markers = min(len(poses), MAX_CANDIDATES)
        positions = np.zeros((MAX_CANDIDATES, 3), np.float32)
        scales = np.zeros((MAX_CANDIDATES, 3), np.float32)
        colours = np.zeros((MAX_CANDIDATES, 3), np.uint8)
        opacities = np.zeros(MAX_CANDIDATES, np.float32)
        wxyzs = np.zeros((MAX_CANDIDATES, 4), np.float32)
        wxyzs[:, 0] = 1.0
        if n_markers:
            highest = max(float(totals.max()), 1e-9)
            shares = np.clip(totals / highest, 0.0, 1.0)
            rejected = np.isin(
                statuses,
                [CANDIDATE_STATUSES.index(status) for status in ("below_threshold", "unreachable")],
            )
            sizes = np.where(rejected, _SMALL, _SMALL + (_LARGE - _SMALL) * np.sqrt(shares))
            positions[:n_markers] = poses[:n_markers, :3]
            scales[:n_markers] = sizes[:n_markers, None]
            # The dark third of the map is left out: it would vanish against the dark background.
            colours[:n_markers] = as_linear(ramp()[(90 + shares[:n_markers] * 165).astype(np.uint8)])
            colours[:n_markers][rejected[:n_markers]] = as_linear(np.array(REJECTED, np.uint8))
            opacities[:n_markers] = np.where(rejected[:n_markers], _FAINT, 1.0)
            wxyzs[:n_markers, 0] = np.cos(poses[:n_markers, 3] / 2)
            wxyzs[:n_markers, 3] = np.sin(poses[:n_markers, 3] / 2)
        self._node.batched_wxyzs = wxyzs
        self._node.batched_positions = positions
        self._node.batched_scales = scales
        self._node.batched_colors = colours
        self._node.batched_opacities = opacities


def marker_mesh() -> tuple[Float32[ndarray, "n_vertices 3"], ndarray]:
    """A ball of 10 cm radius and an arrow of 45 cm along +x."""
    rings, sides, radius = 6, 10, 0.10
    vertices: list[tuple[float, float, float]] = []
    faces: list[tuple[int, int, int]] = []
    for ring in range(rings + 1):
        polar = np.pi * ring / rings
        for side in range(sides):
            turn = 2 * np.pi * side / sides
            vertices.append(
                (
                    radius * float(np.sin(polar) * np.cos(turn)),
                    radius * float(np.sin(polar) * np.sin(turn)),
                    radius * float(np.cos(polar)),
                )
            )
    for ring in range(rings):
        for side in range(sides):
            a, b = ring * sides + side, ring * sides + (side + 1) % sides
            faces += [(a, a + sides, b), (b, a + sides, b + sides)]
    tip = len(vertices)
    vertices.append((0.45, 0.0, 0.0))
    base = len(vertices)
    for side in range(sides):
        turn = 2 * np.pi * side / sides
        vertices.append((0.07, 0.07 * float(np.cos(turn)), 0.07 * float(np.sin(turn))))
    faces += [(tip, base + side, base + (side + 1) % sides) for side in range(sides)]
    return np.array(vertices, np.float32), np.array(faces, np.uint32)

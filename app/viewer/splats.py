"""Layer: the Gaussians, as splats."""

from __future__ import annotations

from typing import Final

import numpy as np
import viser
from jaxtyping import Float32, UInt8
from numpy import ndarray

from app.missions.display import DisplayView
from hgs_core.evaluation.colour_maps import ramp

TILE: Final = 20_000
"""Splats a node. A tile is allocated once it is needed and keeps its size."""


def splat_colours(view: DisplayView, *, shows_quality: bool) -> UInt8[ndarray, "n 3"]:
    """The splats' own colours, or how little is known of them: dark where well known."""
    return ramp()[view.splat_quality] if shows_quality else view.splat_rgb


_EYE: Final = np.eye(3, dtype=np.float32)


class SplatLayer:
    """At most `capacity` splats in tiles of fixed size, padded with transparent ones.

    Splats smaller than `min_radius_m` are drawn at that size: viser drops what is smaller than half a pixel,
    so that a map of 5 mm Gaussians would vanish from across a room. Splats above `clip_height_m` are hidden.
    """

    title = "Gaussians"
    shown_at_first = True

    def __init__(self, server: viser.ViserServer, *, capacity: int, min_radius_m: float) -> None:
        self._server = server
        self._capacity = capacity
        self._min_radius_m = min_radius_m
        self._tiles: list[viser.GaussianSplatHandle] = []
        self._visible = True
        self.clip_height_m = float("inf")
        self.shows_quality = False

    def update(self, view: DisplayView) -> None:
        colours = splat_colours(view, shows_quality=self.shows_quality)
        n_splats = min(len(view.splat_centres_m), self._capacity)
        n_used = -(-n_splats // TILE)
        for tile in range(max(n_used, len(self._tiles))):
            rows = slice(tile * TILE, min((tile + 1) * TILE, n_splats))
            self._fill(
                tile,
                view.splat_centres_m[rows],
                colours[rows],
                view.splat_radii_m[rows],
                view.splat_normals[rows],
                view.splat_opacities[rows],
            )

    def set_visible(self, visible: bool) -> None:
        self._visible = visible
        for tile in self._tiles:
            tile.visible = visible

    def _fill(
        self,
        tile: int,
        centres: Float32[ndarray, "n 3"],
        rgb: UInt8[ndarray, "n 3"],
        radii: Float32[ndarray, " n"],
        normals: Float32[ndarray, "n n_normal"],
        opacities: UInt8[ndarray, " n"],
    ) -> None:
        n_rows = len(centres)
        all_centres = np.zeros((TILE, 3), np.float32)
        all_centres[:n_rows] = centres
        all_centres[n_rows:] = centres[-1] if n_rows else 0.0
        all_rgb = np.zeros((TILE, 3), np.uint8)
        all_rgb[:n_rows] = rgb
        all_opacities = np.zeros((TILE, 1), np.uint8)
        all_opacities[:n_rows, 0] = np.where(centres[:, 2] <= self.clip_height_m, opacities, 0)
        variances = np.full(TILE, self._min_radius_m**2, np.float32)
        variances[:n_rows] = np.maximum(radii, self._min_radius_m) ** 2
        covariances = variances[:, None, None] * _EYE
        if normals.shape[1] == 3:  # discs: as thin as a splat may be
            thinner = self._min_radius_m**2 - variances[:n_rows, None, None]
            covariances[:n_rows] += thinner * normals[:, :, None] * normals[:, None, :]
        if tile < len(self._tiles):
            self._tiles[tile].set_gaussians(all_centres, covariances, all_rgb, all_opacities)
        else:
            self._tiles.append(
                self._server.scene.add_gaussian_splats(
                    f"/gaussians/{tile}",
                    all_centres,
                    covariances,
                    all_rgb,
                    all_opacities,
                    visible=self._visible,
                )
            )

"""Where Gaussians are missing, and what the new ones look like."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Bool, Float32, Int
from numpy import ndarray

from hgs_core.gaussians.gaussian_map import N_PARAMETERS, Primitive
from hgs_core.gaussians.place_order import place_order
from hgs_core.gaussians.rendered_view import RenderedView
from hgs_core.mapping.config import InsertionConfig
from hgs_core.mapping.keyframes import TrainingImage
from hgs_core.mapping.pixel_lattice import lattice_points
from hgs_core.mapping.surface import surface_borders, surface_normals

_CONTRAST_CELL: Final = 4


def missing_pixels(
    image: TrainingImage, rendered: RenderedView, config: InsertionConfig
) -> Bool[ndarray, "height width"]:
    """Measured pixels that the map leaves open, or shows at something farther away."""
    open_ = rendered.silhouette < config.silhouette_threshold
    in_front = rendered.depth_m - image.depth_m > config.depth_margin_m
    return image.measured & (open_ | in_front)


def wanted_spacing(image: TrainingImage, config: InsertionConfig) -> Float32[ndarray, "height width"]:
    """How far apart [m] on the surface Gaussians should be in each pixel; 0 where nothing was measured.

    What `finest_px` (full-image) pixels span at that distance, at least `finest_m`; more where the image has
    less contrast than `detail_contrast`: with its inverse square root, at most `widest_factor` times more
    and `widest_m`.
    Borders of surfaces count as detail: thin legs and edges need small Gaussians whatever their colour.
    """
    measured = image.measured
    depth = np.where(measured, image.depth_m, np.float32(0.0))
    pixel_m = depth / np.float32(2.0 * image.intrinsics.fx)  # of the full image
    finest = np.maximum(np.float32(config.finest_px) * pixel_m, np.float32(config.finest_m))
    contrast = np.maximum(_contrast(image), np.float32(1e-3))
    factor = np.clip(np.sqrt(np.float32(config.detail_contrast) / contrast), 1.0, config.widest_factor)
    factor[surface_borders(image.depth_m)] = 1.0
    spacing = np.minimum(finest * factor, np.maximum(finest, np.float32(config.widest_m)))
    wanted: Float32[ndarray, "height width"] = np.where(measured, spacing, 0.0).astype(np.float32)
    return wanted


@dataclass(frozen=True, kw_only=True, eq=False)
class NewGaussians:
    """What `GaussianMap.append` takes."""

    parameters: Float32[ndarray, "n 8"]
    normals: Float32[ndarray, "n n_normal"]

    def __len__(self) -> int:
        return len(self.parameters)

    def chosen(self, which: Bool[ndarray, " n"] | Int[ndarray, " k"] | slice) -> NewGaussians:
        return NewGaussians(parameters=self.parameters[which], normals=self.normals[which])


def new_gaussians(
    image: TrainingImage,
    wanted: Bool[ndarray, "height width"],
    spacing_m: Float32[ndarray, "height width"],
    config: InsertionConfig,
    primitive: Primitive = "isotropic",
) -> NewGaussians:
    """Gaussians about `spacing_m` apart on the surface seen in the wanted pixels, sorted by place.

    See `lattice_points`. Discs lie in the surface (`surface_normals`).
    """
    at = lattice_points(
        image.depth_m,
        image.intrinsics,
        wanted,
        spacing_m,
        follow_slant=config.follow_slant,
        gap_m=config.widest_m,
        grazing_pitch=config.grazing_pitch,
    )
    parameters = np.empty((len(at.rows), N_PARAMETERS), np.float32)
    parameters[:, 0:3] = image.T_world_camera.apply(at.points_m)
    parameters[:, 3:6] = image.rgb[at.rows, at.columns] / np.float32(255.0)
    parameters[:, 6] = np.log(config.radius_factor * at.apart_m)
    parameters[:, 7] = np.log(config.opacity / (1.0 - config.opacity))
    normals = np.zeros((len(at.rows), 0), np.float32)
    if primitive == "disc":
        seen = surface_normals(image.depth_m, image.intrinsics, at.rows, at.columns)
        normals = (seen @ image.T_world_camera.rotation.T).astype(np.float32)
    return NewGaussians(parameters=parameters, normals=normals).chosen(place_order(parameters[:, 0:3]))


def _contrast(image: TrainingImage) -> Float32[ndarray, "height width"]:
    """How much the brightness (0..1) changes within each pixel's cell of 4 x 4."""
    height, width = image.depth_m.shape
    brightness = image.rgb.sum(axis=2, dtype=np.int16)
    rows, columns = -(-height // _CONTRAST_CELL), -(-width // _CONTRAST_CELL)
    padding = ((0, rows * _CONTRAST_CELL - height), (0, columns * _CONTRAST_CELL - width))
    cells = np.pad(brightness, padding, mode="edge").reshape(rows, _CONTRAST_CELL, columns, _CONTRAST_CELL)
    span = (cells.max(axis=(1, 3)) - cells.min(axis=(1, 3))) / np.float32(3 * 255)
    wide = np.repeat(np.repeat(span, _CONTRAST_CELL, axis=0), _CONTRAST_CELL, axis=1)
    contrast: Float32[ndarray, "height width"] = wide[:height, :width]
    return contrast

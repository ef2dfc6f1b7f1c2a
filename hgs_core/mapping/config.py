"""Settings of the mapper."""

from __future__ import annotations

from pydantic import Field, model_validator

from hgs_core.config.base import StrictConfig
from hgs_core.gaussians.gaussian_map import Primitive
from hgs_core.gaussians.optimise import LearningRates, LossWeights


class DepthFusionConfig(StrictConfig):
    """How noisy depth becomes thin surfaces."""

    smoothing_radius_px: int = Field(1, ge=0)
    """Half-width of the edge-aware window, in pixels of the halved image."""
    smoothing_gate_m: float = Field(0.025, gt=0)
    """How far a pair of opposite pixels may disagree with the centre and still be averaged in."""
    gate_m: float = Field(0.04, ge=0)
    """A Gaussian this near to the measured depth is the surface that the depth shows. With 0, and a slope of
    0, centres are never averaged."""
    gate_slope: float = Field(0.008, ge=0)
    """Growth of that gate per metre of distance."""
    max_observations: int = Field(40, ge=1)
    """The running mean of a centre forgets beyond so many depth images."""


class InsertionConfig(StrictConfig):
    """Where Gaussians are added, and how they start."""

    finest_px: float = Field(2.0, gt=0)
    """Gaussians are as far apart as so many pixels of the full image ..."""
    finest_m: float = Field(0.008, gt=0)
    """... but not nearer to each other than this ..."""
    detail_contrast: float = Field(0.25, gt=0)
    """... where the brightness (0..1) changes by this much within 8 x 8 pixels of the full image."""
    widest_factor: float = Field(4.0, ge=1)
    """Spacing grows where there is less contrast, up to so many times ..."""
    widest_m: float = Field(0.04, gt=0)
    """... and up to this, whatever the camera and the distance, but for what its pixels allow: a map of few
    pixels, too, is to have a centre within 5 cm of all that was seen [m]."""
    radius_factor: float = Field(0.5, gt=0)
    """Radius of a new Gaussian in units of its spacing."""
    follow_slant: bool = True
    """Distances between pixels are measured on the slanted surface; otherwise as if it faced the camera."""
    grazing_pitch: float = Field(0.25, gt=0, le=1)
    """Where pixels are farther apart than `widest_m`, on a surface that is seen at a grazing angle, Gaussians
    are as little as this part of a pixel apart; 1 = one a pixel at most."""
    opacity: float = Field(0.7, gt=0, lt=1)
    silhouette_threshold: float = Field(0.6, gt=0, lt=1)
    """Gaussians are added where less than this of the pixel is covered."""
    depth_margin_m: float = Field(0.04, gt=0)
    """... or where the map lies farther than the measurement by more than this."""
    replace_factor: float = Field(2.5, gt=1)
    """Gaussians so many times larger than this view would place are replaced by finer ones."""


class ThinningConfig(StrictConfig):
    """Under the real clock: which frames go into the voxels alone, so that their time is left for replay."""

    translation_m: float = Field(0.05, ge=0)
    """Only frames from less far than this from the frame learnt last ..."""
    rotation_deg: float = Field(3.0, ge=0)
    """... and turned by less than this ..."""
    psnr_db: float = Field(24.0, gt=0)
    """... whose colours the map foretells at least this well ..."""
    missing_share: float = Field(0.01, ge=0, le=1)
    """... and in which the map leaves out at most this share of the measured surface."""


class MappingConfig(StrictConfig):
    """The Gaussian mapper: bounded work for every frame."""

    primitive: Primitive = "isotropic"
    """What the map is made of: `isotropic` balls, or `disc`s that lie on the surface. A step on discs costs
    about one and a half times as much."""
    iterations_per_s: float = Field(25.0, ge=0)
    """Optimisation steps a second of mission time, one image each, at half resolution (lockstep clock). Under
    the real clock there are as many as time is left for."""
    iterations_accrue_s: float = Field(1.0, ge=0)
    """Steps are earned for at most so long a time between two frames: a long wait brings no burst."""
    current_frame_share: float = Field(0.3, ge=0, le=1)
    """Share of the steps spent on the newest frame."""
    replay_share: float = Field(0.4, ge=0, le=1)
    """Share of the steps spent on any keyframe at all; the others go to keyframes that overlap the frame."""
    keyframe_translation_m: float = Field(0.5, gt=0)
    keyframe_rotation_deg: float = Field(25.0, gt=0)
    """A frame becomes a keyframe when it moved or turned by this much since the last one."""
    max_gaussians: int = Field(5_000_000, ge=1000)
    """Near this budget the lattice of new Gaussians gets coarser; at it none are added."""
    max_gaussians_per_m2: float = Field(50_000.0, gt=0)
    """Where a voxel holds as many as this a square metre, none are added (the finest lattice has 16,000)."""
    prune_interval: int = Field(20, ge=1)
    """Frames between prunings."""
    prune_opacity: float = Field(0.02, gt=0, lt=1)
    """Gaussians fainter than this are dropped."""
    fusion: DepthFusionConfig = DepthFusionConfig()
    insertion: InsertionConfig = InsertionConfig()
    thinning: ThinningConfig = ThinningConfig()
    loss: LossWeights = LossWeights()
    rates: LearningRates = LearningRates()

    @model_validator(mode="after")
    def _shares_fit(self) -> MappingConfig:
        if self.current_frame_share + self.replay_share > 1.0:
            raise ValueError(
                f"current_frame_share {self.current_frame_share} and replay_share {self.replay_share} "
                "add up to more than 1: lower one of them"
            )
        return self

"""Viewpoints and what they would gain."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, runtime_checkable

from jaxtyping import Float, Float32, Int
from numpy import ndarray
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.mapping.snapshot import MapSnapshot


class CoverageMeasure(StrEnum):
    """`volume`: m^3 newly visible, the same at every resolution; `paper`: Eq. 4, summed over pixels;
    `surface`: m^2 of surface to be expected in what is newly visible."""

    VOLUME = "volume"
    PAPER = "paper"
    SURFACE = "surface"


class GainConfig(StrictConfig):
    """How viewpoints are scored (HGS-Planner Eq. 4-10)."""

    method: str = "panorama"
    """Which evaluator: a name that `gain_methods()` lists."""
    coverage_measure: CoverageMeasure = CoverageMeasure.VOLUME
    free_path_m: float = Field(0.8, gt=0)
    """`surface` coverage alone: how far one sees into unobserved space, in the mean, until there is a
    surface."""
    use_coverage: bool = True
    """False: quality alone (the paper's V3)."""
    use_quality: bool = True
    """False: coverage alone (the paper's V2)."""
    adaptive: bool = True
    """False: the observed share lambda_o is taken as 1 (the paper's V4)."""
    prior_information: float = Field(1.0, gt=0)
    """lambda of Eq. 9, for colours: about what one view from a few metres holds of a Gaussian's colour. See
    `parameter_priors` for the other parameters. FisherRF uses 0.1 for all in active mapping."""
    locating_cube_m: float = Field(0.4, gt=0)
    """Views show the same new surface where they come into unseen space through the same cube of this
    edge."""
    coverage_scale_m3: float = Field(1.0, gt=0)
    """Newly visible volume that counts as 1."""
    coverage_scale_m2: float = Field(1.0, gt=0)
    """`surface` coverage: expected new surface that counts as 1."""
    quality_scale_m2: float = Field(50.0, gt=0)
    """Surface seen once more as well as before that counts as 1."""
    quality_saturation_m: float = Field(0.0, ge=0)
    """Nearer than this a view gains no more quality than from here: the map cannot hold finer detail. 0 = the
    paper's gain, which grows without bound towards a surface."""
    surface_scale_m2: float = Field(1.0, gt=0)
    """`surface` alone: newly covered surface that counts as 1."""
    surface_distance_m: float = Field(4.0, gt=0)
    """`surface` alone: a view covers no surface farther away than this."""
    surface_incidence_deg: float = Field(75.0, gt=0, lt=90)
    """`surface` alone: nor any that it sees at a greater angle off its normal."""
    surface_patch_m: float = Field(0.3, gt=0)
    """`surface` alone: surface is thinned to one patch of each direction in a cube of this edge."""
    azimuth_bins: int = Field(120, ge=24)
    elevation_bins: int = Field(32, ge=8)
    quality_elevation_bins: int = Field(12, ge=4)
    """Rows of rays that are scored exactly, of as many columns as `azimuth_bins`."""

    @property
    def coverage_unit(self) -> str:
        """What coverage is counted in, for people."""
        if self.method == "surface" or self.coverage_measure is CoverageMeasure.SURFACE:
            return "m²"
        return "m³" if self.coverage_measure is CoverageMeasure.VOLUME else "m³ px"


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewGains:
    """Gains of `n` viewpoints at their best yaws, and around the full circle.

    `*_by_yaw[i, k]` is the gain of viewpoint `i` with the camera's field of view centred on
    `yaws_rad[k]`; the plain fields are those at the best yaw.
    """

    yaws_rad: Float[ndarray, " n_yaws"]
    coverage_by_yaw: Float[ndarray, "n n_yaws"]
    """[m^3], or the paper's pixel sum; [m^2] of `surface` coverage, and by the evaluator `surface`."""
    quality_by_yaw: Float[ndarray, "n n_yaws"]
    """[m^2] of surface seen once more as well as before."""
    total_by_yaw: Float[ndarray, "n n_yaws"]
    coverage: Float[ndarray, " n"]
    quality: Float[ndarray, " n"]
    total: Float[ndarray, " n"]
    best_yaw_rad: Float[ndarray, " n"]


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceInView:
    """Where one view would see new surface."""

    cubes: Int[ndarray, " n"]
    """Cubes through which its rays come into unseen space, as numbers that are the same for every view of a
    snapshot, rising."""
    area_m2: Float[ndarray, " n"]
    """New surface to be expected behind each."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GainPanorama:
    """What a camera at one place would gain in each direction: for people, as two images all around.

    Column `k` of either looks along the azimuth `-pi + k d` with `d = 2 pi / n_azimuths`; rows go up with the
    tangent of the elevation, from `tan_low` to `tan_high`.
    """

    coverage: Float32[ndarray, "n_rows n_azimuths"]
    """Unobserved volume in sight of each direction [m^3], or new surface to be expected there [m^2]."""
    quality: Float32[ndarray, "n_rays n_azimuths"]
    """Information that each direction would add, in shares of what is known: for comparison only."""
    tan_low: float
    tan_high: float


@runtime_checkable
class Panoramic(Protocol):
    """A `GainEvaluator` that can show what it measures."""

    def panorama(self, snapshot: MapSnapshot, position_m: Float[ndarray, " 3"]) -> GainPanorama: ...


@runtime_checkable
class GainEvaluator(Protocol):
    """Scores viewpoints from the maps alone."""

    def evaluate(
        self,
        snapshot: MapSnapshot,
        positions_m: Float[ndarray, "n 3"],
        *,
        observed_share: float,
        coverage_only: bool = False,
    ) -> ViewGains:
        """Gains of a camera at each position, level, all yaws. `observed_share` is lambda_o of Eq. 10.

        `coverage_only` leaves quality at 0, which is several times as fast, unless there is no other gain.
        """
        ...


@runtime_checkable
class LocatingEvaluator(GainEvaluator, Protocol):
    """An evaluator that also knows where a view's new surface is: so that two views do not count it twice."""

    def new_surface_in_view(
        self, snapshot: MapSnapshot, positions_m: Float[ndarray, "n 3"], yaws_rad: Float[ndarray, " n"]
    ) -> list[SurfaceInView]:
        """What a level camera at each position sees at each yaw (to the nearest that `evaluate` scores)."""
        ...

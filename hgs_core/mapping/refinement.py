"""Improving a finished map from the keyframes that its mission kept."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.errors import MapError
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.optimise import LearningRates, LossWeights, optimise_step
from hgs_core.mapping.keyframe_archive import KeyframeArchive
from hgs_core.mapping.keyframes import TrainingImage


class RefinementConfig(StrictConfig):
    """How a finished map is optimised further."""

    halved_share: float = Field(0.0, ge=0, le=1)
    """The first share of the work looks at halved keyframes (cheaper steps), the rest at full resolution. At
    equal time full resolution alone gives the better pictures."""
    final_rate: float = Field(0.1, gt=0, le=1)
    """Learning rates fall geometrically to this share of the mission's."""


@dataclass(frozen=True, kw_only=True)
class RefinementStep:
    """What one step measured before it moved anything."""

    colour_l1: float
    """Mean absolute colour error of the keyframe, 0..1."""
    depth_l1_m: float
    full_resolution: bool


class Refinement:
    """Optimises a map in place, one keyframe a step, each keyframe once before any comes again.

    Keyframes are read ahead in a thread of their own. Used as a context manager, which ends that thread.
    Raises `MapError` without keyframes.
    """

    def __init__(
        self,
        gaussians: GaussianMap,
        keyframes: KeyframeArchive,
        config: RefinementConfig,
        *,
        loss: LossWeights,
        rates: LearningRates,
        range_m: float,
        rng: np.random.Generator,
    ) -> None:
        if len(keyframes) == 0:
            raise MapError("the run kept no keyframes: there is nothing to refine the map from")
        self._gaussians = gaussians
        self._keyframes = keyframes
        self._config = config
        self._loss = loss
        self._rates = rates
        self._range_m = range_m
        self._order = _shuffled_rounds(len(keyframes), rng)
        self._reader = ThreadPoolExecutor(1, thread_name_prefix="keyframes")
        self._next = self._reader.submit(self._read, full_resolution=config.halved_share == 0.0)

    def __enter__(self) -> Refinement:
        return self

    def __exit__(self, *_: object) -> None:
        self._reader.shutdown(cancel_futures=True)

    def step(self, progress: float) -> RefinementStep:
        """One step; `progress`, from 0 to 1, says how much of the work is done before it.

        Raises `MapError` for a keyframe that cannot be read.
        """
        image = self._next.result()
        full_resolution = progress >= self._config.halved_share
        self._next = self._reader.submit(self._read, full_resolution=full_resolution)
        loss = optimise_step(
            self._gaussians,
            image.rgb,
            image.depth_m,
            image.intrinsics,
            image.T_world_camera,
            weights=self._loss,
            rates=self._rates.scaled(self._config.final_rate**progress),
            range_m=self._range_m,
        )
        return RefinementStep(
            colour_l1=loss.colour_l1,
            depth_l1_m=loss.depth_l1_m,
            full_resolution=image.intrinsics.width == self._keyframes.intrinsics.width,
        )

    def _read(self, *, full_resolution: bool) -> TrainingImage:
        index = next(self._order)
        return self._keyframes.load(index) if full_resolution else self._keyframes.load_halved(index)


def _shuffled_rounds(n: int, rng: np.random.Generator) -> Iterator[int]:
    while True:
        yield from rng.permutation(n).tolist()

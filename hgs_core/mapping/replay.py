"""What optimisation steps learn from: the newest frame, and keyframes again and again."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.optimise import optimise_step
from hgs_core.mapping.config import MappingConfig
from hgs_core.mapping.keyframes import KeyframeStore, TrainingImage

_OVERLAP_MIN = 0.2


class Replay:
    """Chooses an image for every optimisation step, and takes the steps.

    Random numbers are drawn from `rng`, which the caller keeps, saves and restores.
    """

    def __init__(self, config: MappingConfig, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng

    def optimise(
        self,
        gaussians: GaussianMap,
        keyframes: KeyframeStore,
        image: TrainingImage,
        *,
        learn_image: bool,
        range_m: float,
        may_step: Callable[[], bool],
    ) -> int:
        """Take steps as long as `may_step`, asked before each, allows. Returns how many were taken.

        `image` is the newest frame: what overlaps it is preferred; without `learn_image` it is not itself
        learnt from as long as there are keyframes.
        """
        overlap = keyframes.overlap(image, range_m=range_m)
        neighbours = np.flatnonzero(overlap > _OVERLAP_MIN)
        n_steps = 0
        while may_step():
            target = self._target(keyframes, image, neighbours, learn_image=learn_image)
            optimise_step(
                gaussians,
                target.rgb,
                target.depth_m,
                target.intrinsics,
                target.T_world_camera,
                weights=self._config.loss,
                rates=self._config.rates,
                range_m=range_m,
            )
            n_steps += 1
        return n_steps

    def _target(
        self,
        keyframes: KeyframeStore,
        image: TrainingImage,
        neighbours: Int[ndarray, " n"],
        *,
        learn_image: bool,
    ) -> TrainingImage:
        """What one step learns from: the newest frame, a keyframe that overlaps it, or any keyframe."""
        if len(keyframes) == 0:
            return image
        draw = self._rng.random() if learn_image else self._rng.uniform(self._config.current_frame_share, 1.0)
        if draw >= 1.0 - self._config.replay_share:
            return keyframes.load(int(self._rng.integers(len(keyframes))))
        if len(neighbours) and draw >= self._config.current_frame_share:
            return keyframes.load(int(self._rng.choice(neighbours)))
        if not learn_image:
            return keyframes.load(int(self._rng.integers(len(keyframes))))
        return image

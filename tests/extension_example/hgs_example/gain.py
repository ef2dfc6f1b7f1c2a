"""Diminishing returns: the square root of what the built-in evaluator says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.gain.evaluator import PanoramaGainEvaluator
from hgs_core.gain.viewpoint import GainConfig, ViewGains
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.snapshot import MapSnapshot


class SquareRootEvaluator:
    """Implements `GainEvaluator`: best yaws stay the best, but two small views beat one twice as large."""

    def __init__(self, within: PanoramaGainEvaluator) -> None:
        self._within = within

    def evaluate(
        self,
        snapshot: MapSnapshot,
        positions_m: Float[ndarray, "n 3"],
        *,
        observed_share: float,
        coverage_only: bool = False,
    ) -> ViewGains:
        gains = self._within.evaluate(
            snapshot, positions_m, observed_share=observed_share, coverage_only=coverage_only
        )
        return replace(gains, total=np.sqrt(gains.total), total_by_yaw=np.sqrt(gains.total_by_yaw))


def build(config: GainConfig, camera: CameraIntrinsics, range_m: float) -> SquareRootEvaluator:
    return SquareRootEvaluator(PanoramaGainEvaluator(config, camera, range_m))

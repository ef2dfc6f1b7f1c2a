"""The CUDA backend against the reference, as the native one is; where there is a CUDA device."""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
import torch

from hgs_core.errors import ConfigError
from hgs_core.gaussians.gsplat_backend import GsplatBackend
from hgs_core.gaussians.torch_backend import TorchBackend
from tests.gaussians.test_render import CAMERA, POSE, scene

SQUARE = replace(
    CAMERA, fy=CAMERA.fx
)  # a disc of radius sqrt(fx fy) r / z is gsplat's only for square pixels
MISSING = (
    "gsplat is not installed (the extra `cuda`)"
    if importlib.util.find_spec("gsplat") is None
    else "torch finds no CUDA device"
)
CAPPED = 0.02
"""gsplat lets a splat be opaque to 0.999, the model here to 0.99."""
here = pytest.mark.skipif(
    importlib.util.find_spec("gsplat") is None or not torch.cuda.is_available(), reason=MISSING
)


@here
@pytest.mark.parametrize("n", [1, 40, 300])
def test_gsplat_draws_what_the_reference_draws(n: int) -> None:
    gaussians = scene(n, seed=n)
    drawn, reference = (b.forward(gaussians, SQUARE, POSE) for b in (GsplatBackend(), TorchBackend()))
    np.testing.assert_allclose(drawn.colour_sum, reference.colour_sum, atol=CAPPED)
    np.testing.assert_allclose(drawn.depth_sum, reference.depth_sum, atol=5 * CAPPED)
    np.testing.assert_allclose(drawn.silhouette, reference.silhouette, atol=CAPPED)


@here
def test_gsplats_gradient_is_autograds() -> None:
    gaussians = scene(40, seed=40)
    gaussians.parameters[:40, 7] = np.minimum(gaussians.parameters[:40, 7], 3.0)  # below both caps
    rng = np.random.default_rng(5)
    shape = (SQUARE.height, SQUARE.width)
    incoming = (
        rng.normal(size=(*shape, 3)).astype(np.float32),
        rng.normal(size=shape).astype(np.float32),
        rng.normal(size=shape).astype(np.float32),
    )
    drawn, reference = (
        b.backward(gaussians, SQUARE, POSE, *incoming).parameters for b in (GsplatBackend(), TorchBackend())
    )
    scale = np.abs(reference).max(axis=0)
    np.testing.assert_allclose(drawn / scale, reference / scale, atol=1e-3)


@pytest.mark.skipif(
    importlib.util.find_spec("gsplat") is not None and torch.cuda.is_available(), reason="it can run here"
)
def test_without_a_device_the_remedy_is_told() -> None:
    with pytest.raises(ConfigError, match="use 'native'"):
        GsplatBackend()

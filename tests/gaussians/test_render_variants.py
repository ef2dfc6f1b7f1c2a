"""Every instruction-set variant that this processor runs draws and learns the same."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from hgs_core.gaussians.gaussian_map import Primitive
from tests.gaussians.maps import PRIMITIVES

_PROGRAM = """
import sys
import numpy as np
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.information import view_information
from hgs_core.gaussians.native_backend import NativeBackend
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3
import hgs_core.native.kernels as kernels

camera = CameraIntrinsics.centred(75, 50, 50.0)
rng = np.random.default_rng(0)
z = np.linspace(1.0, 4.0, 500)
rows = np.column_stack([rng.uniform(-0.9, 0.9, (500, 2)) * z[:, None], z, rng.uniform(0, 1, (500, 3)),
                        rng.normal(-3.0, 0.5, 500), rng.normal(0.0, 2.0, 500)])
normals = rng.normal(size=(500, 3))
normals /= np.linalg.norm(normals, axis=1, keepdims=True)
gaussians = GaussianMap(primitive=sys.argv[2])
shown = normals.astype(np.float32) if sys.argv[2] == "disc" else None
gaussians.append(rows.astype(np.float32), shown, anchor_keyframe=0)
view = NativeBackend().forward(gaussians, camera, SE3.identity())
ones = np.ones_like(view.colour_sum), np.ones_like(view.depth_sum), np.ones_like(view.silhouette)
gradient = NativeBackend().backward(gaussians, camera, SE3.identity(), *ones)
information = view_information(gaussians, camera, SE3.identity())
np.savez(sys.argv[1], colour=view.colour_sum, gradient=gradient.parameters, normals=gradient.normals,
         information=information)
print(kernels.variant())
"""


def run(variant: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "HGS_KERNEL_VARIANT": variant}
    return subprocess.run(
        [sys.executable, "-c", _PROGRAM, *arguments],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


@PRIMITIVES
def test_variants_agree(primitive: Primitive, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("variants")
    drawn = {}
    for variant in ("portable", "avx2", "avx512"):
        path = folder / f"{variant}.npz"
        done = run(variant, str(path), primitive)
        if variant != "portable" and "cannot run" in done.stderr:
            continue
        assert done.returncode == 0, done.stderr
        assert done.stdout.strip() == variant
        drawn[variant] = dict(np.load(path))
    reference = drawn.pop("portable")
    assert reference["colour"].max() > 0.3
    for arrays in drawn.values():
        np.testing.assert_allclose(arrays["colour"], reference["colour"], atol=1e-5)
        for name in ("gradient", "normals", "information"):
            scale = np.abs(reference[name]).max(axis=0)
            np.testing.assert_allclose(arrays[name] / scale, reference[name] / scale, atol=5e-5)


def test_an_unknown_variant_is_refused_at_import() -> None:
    done = run("mmx", "", "isotropic")
    assert done.returncode != 0
    assert "HGS_KERNEL_VARIANT is 'mmx'; there are: portable, avx2, avx512" in done.stderr

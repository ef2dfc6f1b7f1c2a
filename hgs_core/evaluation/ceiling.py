"""Reachable positions, surface samples and their observability of one scene: computed once, then cached.

They depend on the scene, its start, the robot's size and the camera, never on a mission, and take longer
than all other surface figures together.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from hgs_core.evaluation.observable import observable_mask
from hgs_core.evaluation.reachable import GRID_M, reachable_positions
from hgs_core.evaluation.surface import N_SAMPLES, SAMPLE_SEED, sample_surface
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.textured_mesh import TexturedMesh

_log = logging.getLogger(__name__)

_METHOD_VERSION: Final = 1
"""Raised whenever the rule changes, so that old cache files are not used."""


@dataclass(frozen=True, kw_only=True)
class CeilingRequest:
    """What the ceiling depends on, besides the mesh."""

    start_xy: tuple[float, float]
    robot_radius_m: float
    robot_height_m: float
    camera_height_m: float
    intrinsics: CameraIntrinsics
    range_m: float
    n_samples: int = N_SAMPLES


@dataclass(frozen=True, kw_only=True, eq=False)
class ObservableCeiling:
    """Ground-truth samples, which of them any reachable camera pose can see, and the positions it can be
    at."""

    samples_m: Float[ndarray, "n 3"]
    observable: Bool[ndarray, " n"]
    positions_m: Float[ndarray, "p 2"]

    @property
    def fraction(self) -> float:
        return float(self.observable.mean())


def cache_directory() -> Path:
    """`HGS_CACHE_DIR`, or `~/.cache/hgs`."""
    named = os.environ.get("HGS_CACHE_DIR")
    return Path(named) if named else Path.home() / ".cache" / "hgs"


def observable_ceiling(
    caster: RayCaster, request: CeilingRequest, *, progress: Callable[[str], None] | None = None
) -> ObservableCeiling:
    """The ceiling of the caster's mesh, from the cache where it is known.

    A cache that cannot be read or written costs time, never the figures: it is logged and done without.
    """
    samples = sample_surface(caster.mesh.vertices_m, caster.mesh.triangles, n_samples=request.n_samples)
    path = cache_directory() / f"ceiling-{cache_key(caster.mesh, request, _METHOD_VERSION)}.npz"
    cached = _load(path, request.n_samples)
    if cached is not None:
        observable, positions = cached
        return ObservableCeiling(samples_m=samples, observable=observable, positions_m=positions)
    positions = reachable_positions(
        caster,
        start_xy=request.start_xy,
        radius_m=request.robot_radius_m,
        height_m=request.robot_height_m,
    )
    observable = observable_mask(
        caster,
        samples,
        positions_m=positions,
        camera_height_m=request.camera_height_m,
        intrinsics=request.intrinsics,
        range_m=request.range_m,
        progress=progress,
    )
    _store(path, observable, positions)
    return ObservableCeiling(samples_m=samples, observable=observable, positions_m=positions)


def cache_key(mesh: TexturedMesh, request: CeilingRequest, method: object) -> str:
    """A name for what `method` (plain data, its version included) makes of the mesh and the request."""
    camera = request.intrinsics
    parameters = [
        method,
        SAMPLE_SEED,
        GRID_M,
        *request.start_xy,
        request.robot_radius_m,
        request.robot_height_m,
        request.camera_height_m,
        *(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy),
        request.range_m,
        request.n_samples,
    ]
    digest = hashlib.sha256(json.dumps(parameters).encode())
    digest.update(mesh.vertices_m.tobytes())
    digest.update(mesh.triangles.tobytes())
    return digest.hexdigest()[:32]


def _load(path: Path, n_samples: int) -> tuple[Bool[ndarray, " n"], Float[ndarray, "p 2"]] | None:
    try:
        with np.load(path, allow_pickle=False) as content:
            packed, positions = content["observable"], content["positions_m"]
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        _log.warning("cannot use the cached ceiling %s (%s): computing it again", path, error)
        return None
    if packed.shape != (-(-n_samples // 8),) or positions.ndim != 2 or positions.shape[1] != 2:
        _log.warning("the cached ceiling %s has the wrong shape: computing it again", path)
        return None
    return np.unpackbits(packed, count=n_samples).astype(bool), positions


def _store(path: Path, observable: Bool[ndarray, " n"], positions: Float[ndarray, "p 2"]) -> None:
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("wb") as file:
            np.savez_compressed(file, observable=np.packbits(observable), positions_m=positions)
        partial.replace(path)
    except OSError as error:
        _log.warning("cannot cache the observable ceiling in %s: %s", path, error)

"""What decides a cell's figures besides planner, scene name and seed."""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

import hgs_core
from hgs_core.config.base import StrictConfig
from hgs_core.mission.config import MissionConfig
from hgs_core.mission.versions import software_versions
from hgs_core.native import kernels
from hgs_core.scene.scene import Scene

_DECIDING: Final = ("hgs_core", "configs")
"""What of a checkout decides how a mission goes."""

_SHOWN: Final = 6
"""So many differences are named; the rest is counted."""


class Fingerprint(StrictConfig):
    """Two missions of equal fingerprint, planner and seed have the same trajectory and quality figures."""

    scene: str
    """Digest of the scene's geometry, looks and start, as missions see them."""
    settings: dict[str, Any]
    """The mission's resolved settings, but for those of localisation: simulated missions know their poses."""
    versions: dict[str, str]
    kernel_variant: str

    @staticmethod
    def of(scene_digest: str, config: MissionConfig) -> Fingerprint:
        """Of a mission that this installation would run."""
        return Fingerprint(
            scene=scene_digest,
            settings=config.model_dump(mode="json", exclude={"description", "localisation"}),
            versions=software_versions(),
            kernel_variant=kernels.variant(),
        )


def differences(then: Fingerprint, now: Fingerprint) -> list[str]:
    """Each setting that differs, with both values; empty when the fingerprints are equal."""
    before, after = dict(_leaves(then.model_dump())), dict(_leaves(now.model_dump()))
    keys = [key for key in {**before, **after} if before.get(key) != after.get(key)]
    named = [f"{key} was {before.get(key)!r} and is {after.get(key)!r}" for key in keys[:_SHOWN]]
    return named if len(keys) <= _SHOWN else [*named, f"{len(keys) - _SHOWN} more"]


def scene_digest(scene: Scene) -> str:
    """SHA-256 over everything of a scene that a mission can notice."""
    digest = hashlib.sha256()
    mesh = scene.mesh
    arrays = [mesh.vertices_m, mesh.triangles, mesh.uv, mesh.material_index, mesh.corner_colours]
    for material in mesh.materials:
        arrays += [np.array(material.factor), material.texture]
    start = scene.start
    for array in [*arrays, np.array([start.x_m, start.y_m, start.yaw_rad])]:
        if array is None:
            digest.update(b"none")
            continue
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def source_version() -> str:
    """The last commit that touched sources or presets, `+` behind it where they were changed since; the
    version of an installation that is no checkout."""
    root = Path(hgs_core.__file__).resolve().parents[1]
    if not (root / ".git").exists():
        return hgs_core.__version__
    commit = _git(root, "log", "-1", "--format=%h", "--", *_DECIDING)
    if not commit:
        return hgs_core.__version__
    changed = _git(root, "status", "--porcelain", "--", *_DECIDING)
    return commit if changed == "" else f"{commit}+"


def _git(root: Path, *arguments: str) -> str | None:
    """What git answers; None where there is no git, or it does not serve this folder."""
    try:
        answer = subprocess.run(
            ["git", "-C", str(root), *arguments], capture_output=True, text=True, check=False
        )
    except OSError:
        return None
    return answer.stdout.strip() if answer.returncode == 0 else None


def _leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict) and value:
        for name, child in value.items():
            yield from _leaves(child, f"{key}.{name}" if key else str(name))
    else:
        yield key, value

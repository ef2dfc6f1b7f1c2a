"""What wrong poses cost a map: one from the true poses, beside those from the poses that a method found."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from pydantic import BaseModel, ConfigDict

from hgs_core.benchmark.map_quality import MapQuality, MapTruth
from hgs_core.evaluation.trajectory import Trajectory
from hgs_core.evaluation.trajectory_error import Alignment, aligning, umeyama
from hgs_core.geometry.se3 import SE3
from hgs_core.mission.build import build_mapper
from hgs_core.mission.finished_run import FinishedRun
from hgs_core.native import kernels
from hgs_core.sensing.point_scan import PointScan
from hgs_core.sensing.raw_frame import AlignedFrame

_MAPPER_SEED: Final = 1


class LocalisedMaps(BaseModel):
    """Maps of the same frames, as the run's settings make them, from poses of different origin."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    true_poses: MapQuality
    first_pose: MapQuality
    """From the poses that were found, the first put where it truly was; lost frames are left out."""
    nearest: MapQuality
    """The same, the whole path laid as near to the true one as it comes, directions counted as well."""


def localised_maps(
    run: FinishedRun,
    items: Iterable[AlignedFrame | PointScan],
    truth: Trajectory,
    estimate: Trajectory,
    progress: Callable[[str], None],
) -> LocalisedMaps:
    """Map the frames from the true poses, and those that were located from where they were thought to be."""
    rows = np.flatnonzero(np.isin(truth.timestamps_s, estimate.timestamps_s))
    seen_from = SE3(rotation=truth.poses.rotation[rows], translation=truth.poses.translation[rows])
    onto = {
        "first_pose": aligning(estimate.poses, seen_from, Alignment.FIRST_POSE),
        "nearest": umeyama(_corners(estimate.poses), _corners(seen_from)),
    }
    paths = {"true_poses": truth} | {
        name: Trajectory(timestamps_s=estimate.timestamps_s, poses=motion @ estimate.poses)
        for name, motion in onto.items()
    }
    kernels.set_threads(run.config.threads)
    with tempfile.TemporaryDirectory(prefix="hgs-bench-") as folder:
        mappers = {
            name: build_mapper(
                run.config,
                region=None,
                keyframe_folder=Path(folder) / name,
                rng=np.random.default_rng(_MAPPER_SEED),
            )
            for name in paths
        }
        rows_at = {name: _rows_at(path) for name, path in paths.items()}
        frames = (item for item in items if not isinstance(item, PointScan))
        for number, frame in enumerate(frames):
            for name, mapper in mappers.items():
                row = rows_at[name].get(frame.timestamp_s)
                if row is not None:
                    mapper.integrate(frame.at(paths[name].poses[row]))
                    mapper.optimise(interrupted=lambda: False)
            if number % 10 == 0:
                progress(f"mapping frame {number + 1} of {len(truth)}, from true poses and from found ones")
        for mapper in mappers.values():
            mapper.prune()
        progress("comparing the maps")
        compared = MapTruth.of(run.config, run.open_scene(), truth.poses, run.start_xy)
        qualities = {name: compared.quality_of(mapper.gaussians) for name, mapper in mappers.items()}
    return LocalisedMaps(**qualities)


def _corners(poses: SE3) -> Float[ndarray, "m 3"]:
    """Where cameras are and their axes, 1 m long, end: a straight path leaves no turn open either."""
    ends = poses.translation[:, None, :] + np.swapaxes(poses.rotation, 1, 2)
    return np.concatenate([poses.translation, ends.reshape(-1, 3)])


def _rows_at(path: Trajectory) -> dict[float, int]:
    return {float(time_s): row for row, time_s in enumerate(path.timestamps_s)}

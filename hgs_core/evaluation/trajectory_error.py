"""How far an estimated trajectory is off: absolute and relative pose errors (Sturm et al. 2012)."""

from __future__ import annotations

from enum import StrEnum
from typing import Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from hgs_core.errors import StreamError
from hgs_core.evaluation.report_parts import ReportPart
from hgs_core.evaluation.trajectory import Trajectory
from hgs_core.geometry.se3 import SE3

FEWEST_POSES: Final = 3


class Alignment(StrEnum):
    """How the estimate is laid over the truth before positions are compared."""

    UMEYAMA = "umeyama"
    """The rigid motion that brings all positions nearest to each other (Umeyama 1991, without scale)."""
    FIRST_POSE = "first-pose"
    """The first estimated pose is put where the first true one is: all drift counts."""
    NONE = "none"
    """Both are in one world already."""


class ErrorSpread(ReportPart):
    """Of the errors of one trajectory."""

    rmse: float
    mean: float
    median: float
    max: float


class TrajectoryError(ReportPart):
    """What one estimated trajectory is off by. Relative errors need no alignment."""

    alignment: Alignment
    n_poses: int
    """Estimated poses that have a true one at their time."""
    length_m: float
    """Of the true path between them."""
    ate_m: ErrorSpread
    """Absolute trajectory error: distances of positions after alignment [m]."""
    rpe_delta: int
    """So many poses further on ends the motion whose error is taken."""
    rpe_m: ErrorSpread
    """Relative pose error: translation of the difference of both motions [m]."""
    rpe_deg: ErrorSpread
    """Its rotation angle [degrees]."""
    drift_percent: float
    """Distance of the last positions when the first poses are laid over each other, of the path [%]."""


def trajectory_error(
    estimate: Trajectory,
    truth: Trajectory,
    *,
    alignment: Alignment,
    rpe_delta: int = 1,
    max_difference_s: float = 0.01,
) -> TrajectoryError:
    """Compare the poses whose times are nearest and at most `max_difference_s` apart.

    Raises `StreamError` when fewer than three, or than `rpe_delta` + 1, have a partner.
    """
    mine, theirs = _matched(estimate.timestamps_s, truth.timestamps_s, max_difference_s)
    if len(mine) < max(FEWEST_POSES, rpe_delta + 1):
        raise StreamError(
            f"{len(mine)} of {len(estimate)} estimated poses are within {max_difference_s} s of one of "
            f"{len(truth)} true ones; at least {max(FEWEST_POSES, rpe_delta + 1)} are needed"
        )
    estimated = _rows(estimate.poses, mine)
    true = _rows(truth.poses, theirs)
    aligned = aligning(estimated, true, alignment) @ estimated
    off_m = np.linalg.norm(aligned.translation - true.translation, axis=1)
    relative = _steps(true, rpe_delta).inverse() @ _steps(estimated, rpe_delta)
    turned_deg = np.degrees(np.linalg.norm(relative.log()[:, 3:], axis=1))
    length_m = float(np.linalg.norm(np.diff(true.translation, axis=0), axis=1).sum())
    drifted = aligning(estimated, true, Alignment.FIRST_POSE) @ estimated[-1]
    end_m = float(np.linalg.norm(drifted.translation - true.translation[-1]))
    return TrajectoryError(
        alignment=alignment,
        n_poses=len(mine),
        length_m=length_m,
        ate_m=_spread(off_m),
        rpe_delta=rpe_delta,
        rpe_m=_spread(np.linalg.norm(relative.translation, axis=1)),
        rpe_deg=_spread(turned_deg),
        drift_percent=100.0 * end_m / length_m if length_m > 0 else 0.0,
    )


def aligning(estimate: SE3, truth: SE3, alignment: Alignment) -> SE3:
    """The motion that lays `estimate` over `truth` (both batched over n poses)."""
    if alignment is Alignment.UMEYAMA:
        return umeyama(estimate.translation, truth.translation)
    if alignment is Alignment.FIRST_POSE:
        return truth[0] @ estimate[0].inverse()
    return SE3.identity()


def umeyama(points_m: Float[ndarray, "n 3"], onto_m: Float[ndarray, "n 3"]) -> SE3:
    """The rigid motion of `points_m` with the least sum of squared distances to `onto_m`.

    Positions on one line leave the turn about it open; it is then the least.
    """
    centre, onto = points_m.mean(axis=0), onto_m.mean(axis=0)
    u, _, vt = np.linalg.svd((onto_m - onto).T @ (points_m - centre))
    mirrored = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = (u * mirrored) @ vt
    return SE3(rotation=rotation, translation=onto - rotation @ centre)


def _matched(
    times_s: Float[ndarray, " n"], others_s: Float[ndarray, " m"], at_most_s: float
) -> tuple[Int[ndarray, " k"], Int[ndarray, " k"]]:
    """Rows whose times are nearest to each other, both ways, and near enough."""
    if len(times_s) == 0 or len(others_s) == 0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    nearest = _nearest(others_s, times_s)
    back = _nearest(times_s, others_s)
    rows = np.arange(len(times_s))
    found = (np.abs(others_s[nearest] - times_s) <= at_most_s) & (back[nearest] == rows)
    return rows[found], nearest[found]


def _nearest(sorted_s: Float[ndarray, " m"], wanted_s: Float[ndarray, " n"]) -> Int[ndarray, " n"]:
    after = np.clip(np.searchsorted(sorted_s, wanted_s), 1, max(len(sorted_s) - 1, 1))
    last = len(sorted_s) - 1
    before, after = np.minimum(after - 1, last), np.minimum(after, last)
    earlier = np.abs(sorted_s[before] - wanted_s) <= np.abs(sorted_s[after] - wanted_s)
    return np.where(earlier, before, after)


def _rows(poses: SE3, rows: Int[ndarray, " k"]) -> SE3:
    return SE3(rotation=poses.rotation[rows], translation=poses.translation[rows])


def _steps(poses: SE3, delta: int) -> SE3:
    """The motion from each pose to the one `delta` further on."""
    n = len(poses.translation) - delta
    return poses[:n].inverse() @ poses[delta:]


def _spread(errors: Float[ndarray, " n"]) -> ErrorSpread:
    return ErrorSpread(
        rmse=float(np.sqrt(np.mean(errors**2))),
        mean=float(np.mean(errors)),
        median=float(np.median(errors)),
        max=float(np.max(errors)),
    )

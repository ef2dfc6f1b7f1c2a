"""ATE and RPE: by hand, and against evo."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from hgs_core.errors import StreamError
from hgs_core.evaluation.trajectory import Trajectory
from hgs_core.evaluation.trajectory_error import Alignment, trajectory_error, umeyama
from hgs_core.geometry.se3 import SE3


def trajectory(poses: SE3, times: np.ndarray | None = None) -> Trajectory:
    n = len(poses.translation)
    return Trajectory(timestamps_s=np.arange(n) * 0.1 if times is None else times, poses=poses)


def walk(n: int, seed: int) -> SE3:
    """A smooth path that turns about all axes."""
    rng = np.random.default_rng(seed)
    poses, pose = [], SE3.exp(rng.normal(size=6))
    for _ in range(n):
        poses.append(pose)
        pose = pose @ SE3.exp(rng.normal(size=6) * 0.1)
    return SE3(
        rotation=np.array([p.rotation for p in poses]), translation=np.array([p.translation for p in poses])
    )


def disturbed(poses: SE3, seed: int) -> SE3:
    rng = np.random.default_rng(seed)
    return SE3.exp(rng.normal(size=6)) @ poses @ SE3.exp(rng.normal(size=(len(poses.translation), 6)) * 0.02)


def test_errors_of_a_straight_path_by_hand() -> None:
    """True: 1 m a step along x. Estimated: 1.1 m a step. Laid over at the first pose, the k-th is k * 0.1 m
    off; laid over best, the middles meet. Each step is 0.1 m too long."""
    true = SE3(rotation=np.tile(np.eye(3), (5, 1, 1)), translation=np.arange(5)[:, None] * [1.0, 0, 0])
    estimate = SE3(rotation=true.rotation, translation=1.1 * true.translation)
    first = trajectory_error(trajectory(estimate), trajectory(true), alignment=Alignment.FIRST_POSE)
    assert first.ate_m.max == pytest.approx(0.4)
    assert first.ate_m.mean == pytest.approx(0.2)
    assert first.ate_m.rmse == pytest.approx(np.sqrt((0.01 + 0.04 + 0.09 + 0.16) / 5))
    assert first.rpe_m.rmse == first.rpe_m.max == pytest.approx(0.1)
    assert first.rpe_deg.max == pytest.approx(0.0, abs=1e-6)
    assert (first.n_poses, first.length_m, first.drift_percent) == (5, 4.0, pytest.approx(10.0))
    best = trajectory_error(trajectory(estimate), trajectory(true), alignment=Alignment.UMEYAMA)
    assert best.ate_m.max == pytest.approx(0.2)
    two = trajectory_error(trajectory(estimate), trajectory(true), alignment=Alignment.NONE, rpe_delta=2)
    assert two.rpe_m.max == pytest.approx(0.2)


@given(
    points=arrays.arrays(float, (6, 3), elements=st.floats(-5, 5)),
    twist=arrays.arrays(float, 6, elements=st.floats(-2, 2)),
)
def test_umeyama_undoes_a_rigid_motion(points: np.ndarray, twist: np.ndarray) -> None:
    motion = SE3.exp(twist)
    found = umeyama(points, motion.apply(points))
    np.testing.assert_allclose(found.apply(points), motion.apply(points), atol=1e-6)
    np.testing.assert_allclose(found.rotation.T @ found.rotation, np.eye(3), atol=1e-9)
    assert np.linalg.det(found.rotation) == pytest.approx(1.0)


def test_errors_do_not_depend_on_where_the_estimate_began() -> None:
    true = walk(40, 0)
    estimate = disturbed(true, 1)
    moved = SE3.exp(np.array([3.0, -2.0, 1.0, 0.5, 0.2, -1.0])) @ estimate
    for alignment in (Alignment.UMEYAMA, Alignment.FIRST_POSE):
        one, other = (
            trajectory_error(trajectory(poses), trajectory(true), alignment=alignment)
            for poses in (estimate, moved)
        )
        assert one.ate_m.rmse == pytest.approx(other.ate_m.rmse)
        assert one.rpe_deg.rmse == pytest.approx(other.rpe_deg.rmse)


def test_poses_are_compared_with_the_true_ones_of_their_time() -> None:
    true = walk(20, 2)
    times = np.arange(20) * 0.1
    every_third = SE3(rotation=true.rotation[::3], translation=true.translation[::3])
    error = trajectory_error(
        trajectory(every_third, times[::3] + 0.004), trajectory(true, times), alignment=Alignment.NONE
    )
    assert error.n_poses == 7
    assert error.ate_m.max == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(StreamError, match=r"0 of 7 estimated poses are within 0\.001 s .* at least 3"):
        trajectory_error(
            trajectory(every_third, times[::3] + 0.004),
            trajectory(true, times),
            alignment=Alignment.NONE,
            max_difference_s=0.001,
        )


@pytest.mark.parametrize("seed", [0, 1])
def test_evo_finds_the_same_errors(seed: int) -> None:
    evo_metrics = pytest.importorskip("evo.core.metrics")
    evo_trajectory = pytest.importorskip("evo.core.trajectory")
    true = walk(60, seed)
    estimate = disturbed(true, seed + 10)
    theirs = [
        evo_trajectory.PoseTrajectory3D(poses_se3=list(poses.as_matrix()), timestamps=np.arange(60) * 0.1)
        for poses in (true, estimate)
    ]
    unit = evo_metrics.Unit.frames
    for relation, read in (
        (evo_metrics.PoseRelation.translation_part, lambda error: error.rpe_m),
        (evo_metrics.PoseRelation.rotation_angle_deg, lambda error: error.rpe_deg),
    ):
        for delta in (1, 5):
            rpe = evo_metrics.RPE(relation, delta=delta, delta_unit=unit, all_pairs=True)
            rpe.process_data(tuple(theirs))
            mine = trajectory_error(
                trajectory(estimate), trajectory(true), alignment=Alignment.UMEYAMA, rpe_delta=delta
            )
            expected = rpe.get_all_statistics()
            for name in ("rmse", "mean", "median", "max"):
                assert getattr(read(mine), name) == pytest.approx(expected[name], rel=1e-6)
    for alignment in (Alignment.UMEYAMA, Alignment.FIRST_POSE):
        reference, aligned = (
            theirs[0],
            evo_trajectory.PoseTrajectory3D(
                poses_se3=list(estimate.as_matrix()), timestamps=np.arange(60) * 0.1
            ),
        )
        if alignment is Alignment.UMEYAMA:
            aligned.align(reference)
        else:
            aligned.align_origin(reference)
        ape = evo_metrics.APE(evo_metrics.PoseRelation.translation_part)
        ape.process_data((reference, aligned))
        mine = trajectory_error(trajectory(estimate), trajectory(true), alignment=alignment)
        for name in ("rmse", "mean", "median", "max"):
            assert getattr(mine.ate_m, name) == pytest.approx(ape.get_all_statistics()[name], rel=1e-6)

"""TUM trajectory files."""

from pathlib import Path

import numpy as np
import pytest

from hgs_core.errors import StreamError
from hgs_core.evaluation.trajectory import Trajectory, read_trajectory, write_trajectory
from hgs_core.geometry.se3 import SE3


def random_trajectory(n: int) -> Trajectory:
    rng = np.random.default_rng(0)
    return Trajectory(timestamps_s=np.arange(n) * 0.4, poses=SE3.exp(rng.normal(size=(n, 6))))


def test_round_trip(tmp_path: Path) -> None:
    trajectory = random_trajectory(30)
    write_trajectory(trajectory, tmp_path / "trajectory.txt")
    again = read_trajectory(tmp_path / "trajectory.txt")
    np.testing.assert_allclose(again.timestamps_s, trajectory.timestamps_s, atol=1e-6)
    np.testing.assert_allclose(again.poses.as_matrix(), trajectory.poses.as_matrix(), atol=1e-7)
    assert [path.name for path in tmp_path.iterdir()] == ["trajectory.txt"]


def test_empty_round_trip(tmp_path: Path) -> None:
    empty = Trajectory(
        timestamps_s=np.zeros(0), poses=SE3(rotation=np.zeros((0, 3, 3)), translation=np.zeros((0, 3)))
    )
    write_trajectory(empty, tmp_path / "trajectory.txt")
    assert len(read_trajectory(tmp_path / "trajectory.txt")) == 0


def test_columns_are_translation_then_quaternion_with_w_last(tmp_path: Path) -> None:
    """A quarter turn about z: quaternion xyzw = (0, 0, sin 45, cos 45)."""
    quarter = SE3.from_quaternion_wxyz(np.array([[0.5**0.5, 0, 0, 0.5**0.5]]), np.array([[1.0, 2.0, 3.0]]))
    write_trajectory(Trajectory(timestamps_s=np.array([0.5]), poses=quarter), tmp_path / "t.txt")
    row = (tmp_path / "t.txt").read_text().splitlines()[1].split()
    np.testing.assert_allclose(
        [float(word) for word in row], [0.5, 1, 2, 3, 0, 0, 0.5**0.5, 0.5**0.5], atol=1e-8
    )


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("0 1 2 3 0 0 0", "8 finite"),
        ("0 1 2 nan 0 0 0 1", "8 finite"),
        ("0 1 2 x 0 0 0 1", "not a row"),
        ("0 1 2 3 0 0 0 2", "norm 2"),
    ],
)
def test_bad_lines_are_named(tmp_path: Path, line: str, reason: str) -> None:
    (tmp_path / "t.txt").write_text(f"# comment\n0 0 0 0 0 0 0 1\n{line}\n")
    with pytest.raises(StreamError, match=rf"t\.txt:3: .*{reason}"):
        read_trajectory(tmp_path / "t.txt")


def test_absent_file(tmp_path: Path) -> None:
    with pytest.raises(StreamError, match="cannot read"):
        read_trajectory(tmp_path / "t.txt")

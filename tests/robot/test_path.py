import numpy as np
import pytest

from hgs_core.robot.path import Path


def path(*yaws_rad: float) -> Path:
    n = len(yaws_rad)
    return Path(positions_m=np.column_stack([np.arange(n), np.zeros(n)]), yaws_rad=np.array(yaws_rad))


@pytest.mark.parametrize(
    ("whole", "length_m"),
    [(path(np.nan, np.nan, 0.5, np.nan, 1.0), 2.0), (path(0.3, 0.5), 0.0), (path(np.nan, np.nan), 1.0)],
)
def test_a_path_is_cut_behind_its_first_view(whole: Path, length_m: float) -> None:
    cut = whole.to_first_view()
    assert cut.length_m == length_m
    assert np.count_nonzero(np.isfinite(cut.yaws_rad)) <= 1
    np.testing.assert_array_equal(cut.positions_m, whole.positions_m[: len(cut.yaws_rad)])


def test_a_path_without_waypoints_stays_empty() -> None:
    assert Path.empty().to_first_view().length_m == 0.0

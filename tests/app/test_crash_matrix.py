"""Kills at random moments: no mission is lost, no file is corrupt, every one ends as if nothing had been."""

import os

import pytest

from tests.app.crash_matrix import CrashMatrix


def test_missions_that_were_killed_end_as_others_do(tmp_path, repository):
    matrix = CrashMatrix(tmp_path, repository, seed=1, time_s=6.0)
    counts = matrix.run(3)
    assert (counts.lost, counts.corrupt, counts.different) == (0, [], [])


@pytest.mark.slow
def test_a_hundred_kills(tmp_path, repository, capsys):
    kills = int(os.environ.get("HGS_CRASH_KILLS", "100"))
    matrix = CrashMatrix(tmp_path, repository, seed=0, time_s=10.0)
    try:
        matrix.run(kills)
    finally:
        with capsys.disabled():
            print(f"\ncrash matrix: {matrix.counts}")  # noqa: T201
    counts = matrix.counts
    assert (counts.lost, counts.corrupt, counts.different) == (0, [], [])

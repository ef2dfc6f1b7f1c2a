"""Faults of the link at random moments: nothing is touched, nothing crashes, missions go on to their end."""

import os

import pytest

from tests.app.robot.fault_matrix import FAULTS, FaultMatrix


@pytest.mark.timeout(600)
def test_a_mission_survives_faults_of_its_link(tmp_path, repository):
    matrix = FaultMatrix(tmp_path, repository, seed=2, time_s=8.0, longest_cut_s=2.0)
    counts = matrix.run(1, faults_each=4)
    assert (counts.collisions, counts.wrong) == (0, [])
    assert counts.faults.total() > 0


@pytest.mark.slow
def test_fifty_missions_over_a_bad_line(tmp_path, repository, capsys):
    missions = int(os.environ.get("HGS_FAULT_MISSIONS", "50"))
    matrix = FaultMatrix(tmp_path, repository, seed=0, time_s=20.0, longest_cut_s=30.0)
    try:
        matrix.run(missions, faults_each=3)
    finally:
        with capsys.disabled():
            print(f"\nfault matrix: {matrix.counts}")  # noqa: T201
    counts = matrix.counts
    assert (counts.collisions, counts.wrong) == (0, [])
    assert missions < 10 or set(counts.faults) == set(FAULTS)

"""A mission that begins with an old map visits what is missing in it, and nothing else."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hgs_core.errors import ConfigError
from hgs_core.mapping.keyframe_archive import KeyframeArchive
from hgs_core.mission.finished_run import resuming_request
from hgs_core.mission.old_map import training_poses
from hgs_core.mission.run import NoCommands, run_mission
from tests.mission.small_room import write_small_room
from tests.mission.test_resume import Watched, kill_at, of_mission, request


def finished(wish):
    watched = Watched()
    report = run_mission(wish, observer=watched, commands=NoCommands())
    assert report is not None
    return report, [event for event in watched.events if event.kind == "telemetry"]


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_small_room(tmp_path_factory.mktemp("room"))


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory, room: Path):
    """A mission that was cut short."""
    out = tmp_path_factory.mktemp("first") / "run"
    return out, *finished(request(room, out, time_s=12.0))


def test_the_second_mission_knows_what_the_first_knew(tmp_path: Path, room: Path, first) -> None:
    out, before, frames = first
    wish = replace(request(room, tmp_path / "second", time_s=5.0), extends=out)
    after, extended = finished(wish)
    # No look around: it drives at once, and never knows less.
    assert extended[0].observed_volume_m3 >= frames[-1].observed_volume_m3 * 0.999
    assert extended[-1].observed_volume_m3 > frames[-1].observed_volume_m3
    assert extended[0].n_gaussians >= 0.95 * before.n_gaussians
    assert np.isnan(extended[0].psnr_current_db) or extended[0].psnr_current_db > 15.0
    assert after.extends == str(out)
    assert after.frames == len(extended)
    keyframes = KeyframeArchive.open(tmp_path / "second")
    earlier = keyframes.timestamps_s < 0
    assert np.count_nonzero(earlier) == before.keyframes
    assert len(keyframes) == after.keyframes > before.keyframes
    assert np.all(np.diff(keyframes.timestamps_s) > 0)
    assert len(training_poses(tmp_path / "second").translation) == after.frames + before.keyframes
    old = KeyframeArchive.open(out)
    np.testing.assert_array_equal(keyframes.load(0).rgb, old.load(0).rgb)
    assert os.path.samefile(keyframes.files(0)[0], old.files(0)[0])


def test_an_extending_mission_that_was_killed_goes_on_too(tmp_path: Path, room: Path, first) -> None:
    out, *_ = first
    wish = replace(request(room, tmp_path / "whole", time_s=4.0), extends=out)
    finished(wish)
    for frame, name in ((1, "early"), (8, "late")):
        kill_at(frame, replace(wish, out=tmp_path / name))
        finished(resuming_request(tmp_path / name))
        assert of_mission(tmp_path / name) == of_mission(tmp_path / "whole")
        for file in ("map.ply", "transforms.json"):
            assert (tmp_path / name / file).read_bytes() == (tmp_path / "whole" / file).read_bytes()


def test_a_map_that_does_not_fit_is_refused_in_words(tmp_path: Path, room: Path, first) -> None:
    out, *_ = first
    other = write_small_room(tmp_path)
    for wish, says in (
        (request(other, tmp_path / "x"), "it is of the scene"),
        (
            request(room, tmp_path / "x", sensor="rgbd_5m_small"),
            r"sensor\.camera\.width is \d+ there and 600 here",
        ),
        (
            request(room, tmp_path / "x", **{"mapping.primitive": "disc"}),
            "primitive is isotropic there and disc",
        ),
    ):
        with pytest.raises(ConfigError, match=says):
            run_mission(replace(wish, extends=out), observer=Watched(), commands=NoCommands())
    wish = replace(request(room, tmp_path / "x"), extends=tmp_path / "nothing")
    with pytest.raises(ConfigError, match="is not a folder"):
        run_mission(wish, observer=Watched(), commands=NoCommands())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["room.glb"]


@pytest.mark.slow
def test_extending_a_complete_map_is_much_shorter_and_sees_no_less(tmp_path: Path, room: Path) -> None:
    settings = {"evaluate": "true", "checkpoint.interval_s": "0"}
    whole, _ = finished(request(room, tmp_path / "whole", time_s=300.0, **settings))
    assert whole.stop_reason == "complete"
    again, _ = finished(
        replace(request(room, tmp_path / "again", time_s=300.0, **settings), extends=tmp_path / "whole")
    )
    assert again.stop_reason == "complete"
    assert again.sim_time_s < 0.25 * whole.sim_time_s
    assert again.completion_ratio_observable >= whole.completion_ratio_observable - 0.001
